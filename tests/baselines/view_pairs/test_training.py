"""`view-pairs` learns from images and cameras alone, and goes on as if never stopped."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from h5_edits import put, values
from pix2shape_models import edited

torch = pytest.importorskip("torch")
from baselines.checkpoints import load_weights  # noqa: E402
from baselines.depth_supervised import training as shared  # noqa: E402
from baselines.depth_supervised.card import recipe  # noqa: E402
from baselines.pix2shape.matching.labels import FOLDER  # noqa: E402
from baselines.tensor_files import load_tensors  # noqa: E402
from baselines.view_pairs import train, write_submission  # noqa: E402

TOLD = {"size": 32, "width": 0.25, "iterations": 4, "batch": 4, "seed": 5}
UNSEEN = (
    "depth", "normal", "object_id", "object/shape", "object/world_from_object", "object/scale",
    "object/visible_pixels", "object/count", "light/position", "light/color", "light/ambient",
    "light/attenuation", "material/reflectance",
)  # fmt: skip


def weights_of(path: Path) -> dict[str, Any]:
    return load_tensors(path)[0]


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(torch.equal(one[name], other[name]) for name in one)


def test_nothing_but_images_and_cameras_is_read(near_path, tmp_path):
    edits = [values(name, np.zeros_like) for name in UNSEEN]
    edits.append(values("scene", lambda old: np.full_like(old, b"{}")))
    blank = edited(near_path, tmp_path / "blank.h5", *edits)
    expected = weights_of(train(near_path, tmp_path / "one", **TOLD))
    assert same(weights_of(train(blank, tmp_path / "two", **TOLD)), expected)
    other = edited(near_path, tmp_path / "other.h5", put("image", 1, np.float16(0.5)))
    assert not same(weights_of(train(other, tmp_path / "three", **TOLD)), expected)


def test_a_run_goes_on_as_if_it_had_never_stopped(near_path, tmp_path, monkeypatch):
    monkeypatch.setattr(shared, "EVERY", 2)
    whole = train(near_path, tmp_path / "whole", **TOLD)

    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(near_path, tmp_path / "cut", **TOLD, progress=stop)
    assert len(list((tmp_path / "cut" / FOLDER).iterdir())) == 1, "stopped after the labels"
    with pytest.raises(KeyboardInterrupt):
        train(near_path, tmp_path / "cut", **TOLD, progress=lambda i, n, now: i == 3 and stop())
    again = train(near_path, tmp_path / "cut", resume=True)
    assert same(weights_of(again), weights_of(whole))
    assert load_weights(again, recipe("view-pairs")).card.iteration == 4
    write_submission(near_path, tmp_path / "p.h5", again)
    assert (tmp_path / "p.h5").exists()

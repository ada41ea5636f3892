"""Submissions: valid, from images and cameras alone, each view from the image that is said."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from h5_edits import put, values
from pix2shape_models import edited

from metrics.submissions.validation import validate
from scenegen.common.errors import FileFormatError, SpecError

torch = pytest.importorskip("torch")
from baselines.pix2shape.use import predict  # noqa: E402
from baselines.relief.depth_supervised import METHOD, write_submission  # noqa: E402
from baselines.relief.network import Card, Settings, relief_network  # noqa: E402
from baselines.training.checkpoint import Method, new_state, save_weights  # noqa: E402

TRUTH = (
    "depth", "normal", "object_id", "object/shape", "object/world_from_object", "object/scale",
    "object/visible_pixels", "object/count", "light/position", "light/color", "light/ambient",
    "light/attenuation", "material/reflectance", "view_angle_degrees",
)  # fmt: skip


@pytest.fixture(autouse=True)
def few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """9 rows take three batches, and do not fill the last one."""
    monkeypatch.setattr(predict, "BATCH", 4)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return weights of both kinds whose relief differs clearly from image to image."""
    found = {}
    for kind in ("unet", "code"):
        method = Method(METHOD, Card, relief_network)
        state = new_state(method, Card(METHOD, Settings(kind, 32, 0.1)))
        with torch.no_grad():
            for name, value in state.network.named_parameters():
                value.mul_(10 if name.endswith("last.weight") else 1)
        found[kind] = tmp_path_factory.mktemp(kind) / "w.safetensors"
        save_weights(found[kind], method, state.network, state.card)
    return found


def submitted(data: Path, out: Path, weights: Path) -> dict[str, Any]:
    write_submission(data, out, weights, overwrite=True)
    with h5py.File(out) as file:
        return {name: file[name][()] for name in ("depth", "normal")} | dict(file.attrs)


@pytest.mark.parametrize("kind", ["unet", "code"])
def test_a_submission_is_valid_and_says_what_it_is(kind, weights, turned_path, tmp_path):
    done: list[tuple[int, int]] = []
    out = tmp_path / "p.h5"
    write_submission(turned_path, out, weights[kind], progress=lambda *now: done.append(now))
    assert done == [(4, 9), (4, 9), (1, 9)]
    assert [p for p in validate(out) if not p.is_hint] == []
    found = submitted(turned_path, out, weights[kind])
    assert found["method"] == "depth-supervised" + ("" if kind == "unet" else "-code")
    assert ("its own image" if kind == "unet" else "scene's first one") in found["notes"]
    assert len({depth.tobytes() for depth in found["depth"]}) == 9
    np.testing.assert_allclose(np.linalg.norm(found["normal"], axis=-1), 1, rtol=1e-4)


@pytest.mark.parametrize(("kind", "changed"), [("unet", [4]), ("code", [])])
def test_an_image_says_something_about_the_views_that_are_said(
    kind, changed, weights, turned_path, tmp_path
):
    """Row 4 is view 1 of scene 1; row 3 is its view 0."""
    noise = np.random.default_rng(0).integers(0, 255, (32, 32, 3), "u1")
    before = submitted(turned_path, tmp_path / "p.h5", weights[kind])["depth"]
    for row, expected in ((4, changed), (3, [3] if kind == "unet" else [3, 4, 5])):
        path = edited(turned_path, tmp_path / f"{row}.h5", put("image", row, noise))
        found = submitted(path, tmp_path / "q.h5", weights[kind])["depth"]
        assert [i for i in range(9) if (found[i] != before[i]).any()] == expected


@pytest.mark.parametrize("kind", ["unet", "code"])
def test_nothing_of_the_truth_is_read(kind, weights, turned_path, tmp_path):
    edits = [values(name, np.zeros_like) for name in TRUTH]
    edits.append(values("scene", lambda old: np.full_like(old, b"{}")))
    path = edited(turned_path, tmp_path / "blank.h5", *edits)
    expected = submitted(turned_path, tmp_path / "p.h5", weights[kind])
    found = submitted(path, tmp_path / "q.h5", weights[kind])
    assert np.array_equal(found["depth"], expected["depth"])
    assert np.array_equal(found["normal"], expected["normal"])
    moved = put("camera/world_from_camera", (4, 0, 3), 1.6)
    path = edited(turned_path, tmp_path / "camera.h5", moved)
    found = submitted(path, tmp_path / "q.h5", weights[kind])
    assert not np.array_equal(found["depth"][4], expected["depth"][4]), "cameras are"


@pytest.mark.parametrize("factor", [1, 2])
def test_larger_images_are_predicted_at_their_own_size(factor, weights, make_rooms, tmp_path):
    size = 32 * factor
    path = make_rooms(tmp_path / "r.h5", 2, height=size, width=size)
    assert submitted(path, tmp_path / "p.h5", weights["unet"])["depth"].shape == (2, size, size)


def test_what_cannot_be_predicted_is_refused_and_nothing_is_left(
    weights, turned_path, float_path, tmp_path
):
    out = tmp_path / "p.h5"
    edit = put("camera/world_from_camera", (4, 1, 3), np.nan)
    path = edited(turned_path, tmp_path / "bad.h5", edit)
    with pytest.raises(FileFormatError) as error:
        write_submission(path, out, weights["unet"])
    assert error.value.where == f"{path}: camera/world_from_camera, row 4"
    with pytest.raises(SpecError, match="images of 48x40"):
        write_submission(float_path, out, weights["unet"])
    with pytest.raises(FileFormatError, match="HDF5"):
        write_submission(weights["unet"], out, weights["unet"])
    assert not out.exists()
    out.write_text("mine")
    with pytest.raises(FileExistsError, match="--overwrite"):
        write_submission(turned_path, out, weights["unet"])
    assert out.read_text() == "mine"

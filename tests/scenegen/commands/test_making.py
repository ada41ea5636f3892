"""Options of `scenegen render` for closed rooms: what is told, and when."""

import json

import h5py
import numpy as np
import pytest

from scenegen.commands.making import NOISY_SPP
from scenegen.description.specs import PAPER_ONLY
from scenegen.rendering.pictures import denoiser

RENDER = (
    "render",
    "--preset",
    "interiors",
    "--n",
    1,
    "--size",
    16,
    "--objects",
    4,
    "--out",
    "o.h5",
)


@pytest.fixture
def no_denoiser(monkeypatch):
    monkeypatch.setattr(denoiser, "has_denoiser", lambda: False)


@pytest.mark.parametrize(
    ("options", "word"),
    [("--hours 30", "--hours"), ("--batch 0", "--batch"), ("--out none/x.h5", "none"),
     ("--materials nosuch", "nosuch"), ("--environment nosuch.exr", "nosuch.exr"),
     ("--objects-root meshes", "--objects-root"), ("--shapes box", "--shapes"),
     ("--denoise", "--denoise"), ("--objects 0-4", "--objects")],
)  # fmt: skip
@pytest.mark.usefixtures("no_denoiser")
def test_a_wrong_option_is_all_that_is_told(refuses, tmp_path, options, word):
    import trimesh

    (tmp_path / "meshes" / "mug").mkdir(parents=True)
    trimesh.creation.box((1, 2, 1)).export(tmp_path / "meshes" / "mug" / "1.obj")
    refuses(*RENDER, *options.split(), words=(word,))


@pytest.mark.parametrize("asset", ["materials", "environment"])
def test_rooms_without_them_take_no_assets(refuses, asset):
    refuses("render", "--n", 1, "--out", "o.h5", f"--{asset}", "nosuch", words=(f"--{asset}",))


@pytest.mark.usefixtures("no_denoiser")
def test_without_a_denoiser_more_paths_are_traced_and_that_is_told_first(run):
    made = run(*RENDER)
    assert made.exit_code == 0, made.output
    assert str(NOISY_SPP) in made.stdout.splitlines()[0]
    with h5py.File("o.h5") as file:
        assert json.loads(file.attrs["spec"])["spp"] == NOISY_SPP
        assert np.isfinite(file["image"][0]).all()


def test_info_leaves_out_settings_of_the_papers_room(run):
    assert run(*RENDER, "--spp", 1, "--no-denoise").exit_code == 0
    words = set(run("info", "o.h5").stdout.split())
    assert {"hours", "sensor_noise", "views"} <= words
    assert not {*PAPER_ONLY} & words

"""Options of `scenegen render` for closed rooms: what is told, and when."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from PIL import Image

from scenegen.commands.making import NOISY_SPP
from scenegen.description.specs import request_from_json
from scenegen.rendering.pictures import denoiser
from scenegen.rendering.pictures.assets import digest_of

RENDER = "render --preset interiors --n 1 --size 16 --objects 4 --out o.h5"


@pytest.fixture
def no_denoiser(monkeypatch):
    monkeypatch.setattr(denoiser, "has_denoiser", lambda: False)


@pytest.mark.parametrize(
    ("options", "word"),
    [("--hours 30", "--hours"), ("--batch 0", "--batch"), ("--out none/x.h5", "none"),
     ("--materials nosuch", "nosuch"), ("--environment nosuch.exr", "nosuch.exr"),
     ("--objects-root nosuch", "nosuch"), ("--shapes box", "--shapes"),
     ("--denoise", "--denoise"), ("--objects 0-4", "--objects")],
)  # fmt: skip
@pytest.mark.usefixtures("no_denoiser")
def test_a_wrong_option_is_all_that_is_told(refuses, options, word):
    refuses(*RENDER.split(), *options.split(), words=(word,))


@pytest.mark.usefixtures("no_denoiser")
def test_without_a_denoiser_more_paths_are_traced_and_that_is_told_first(run):
    made = run(*RENDER.split())
    assert made.exit_code == 0, made.output
    assert str(NOISY_SPP) in made.stdout.splitlines()[0]
    with h5py.File("o.h5") as file:
        assert json.loads(file.attrs["spec"])["spp"] == NOISY_SPP
        assert np.isfinite(file["image"][0]).all()


@pytest.fixture
def own_wood(run, tmp_path):
    """A folder of a material, with which o.h5 was made."""
    (tmp_path / "mats").mkdir()
    Image.new("RGB", (8, 8), (200, 10, 10)).save(tmp_path / "mats" / "Wood01_1K_Color.png")
    made = run(*RENDER.split(), "--spp", 1, "--no-denoise", "--materials", "mats")
    assert made.exit_code == 0, made.output
    return tmp_path / "mats"


def test_verify_needs_what_the_file_was_made_with(run, refuses, own_wood):
    refuses("verify", "o.h5", words=("--materials",))
    assert run("verify", "o.h5", "--items", 0).exit_code == 0
    assert run("verify", "o.h5", "--materials", own_wood).exit_code == 0
    (own_wood / "more.txt").write_text("x")
    digest_of.cache_clear()  # the bytes of a folder are read once in a process
    refuses("verify", "o.h5", "--materials", own_wood, words=("mats",))


def test_a_missing_denoiser_is_told_before_a_file_is_read(monkeypatch, refuses, interior_path):
    with h5py.File(interior_path) as file:
        spec = request_from_json(file.attrs["spec"])
    monkeypatch.setattr(denoiser, "has_denoiser", lambda: False)
    monkeypatch.setattr("scenegen.rooms.reader.request_from_json",
                        lambda _: replace(spec, denoise=True))  # fmt: skip
    refuses("verify", interior_path, words=("--items 0",))

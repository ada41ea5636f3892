"""Commands as a user types them: options reach the request, help tells defaults and examples."""

import json
import shlex
import sys

import h5py
import pytest

from scenegen.description.presets import PATH_SAMPLES

SOME = "render --n 4 --out x.h5 --seed 3 --size 32x48 --shapes box,teapot --compression lzf"


def test_the_command_is_recorded_without_what_changes_no_byte(run, monkeypatch, tmp_path):
    (tmp_path / "x.h5").write_text("to be replaced")
    words = [*SOME.split(), "--batch", "2", "--overwrite"]
    monkeypatch.setattr(sys, "argv", ["/somewhere/scenegen", *words])
    assert run(*words).exit_code == 0
    with h5py.File("x.h5") as file:
        assert file.attrs["creation_command"] == f"scenegen {SOME}"
        assert file["image"].shape == (4, 32, 48, 3)
        assert file["image"].compression == "lzf"


@pytest.mark.parametrize(
    ("option", "setting"),
    [
        ("--no-shadows", ("shadows", False)),
        ("--reflectance 0.2,0.3,0.4", ("room_reflectance", [0.2, 0.3, 0.4])),
        ("--shading path --spp 1", ("shading", "path")),
        ("--shading path", ("spp", PATH_SAMPLES)),
        ("--preset specular --shininess 30", ("shininess", [30, 30])),
        ("--preset albedo --same-reflectance", ("random_reflectance", False)),
        ("--classes mug,bowl", ("source", "families")),
        ("--classes 'mug, bowl'", ("shapes", ["mug", "bowl"])),
        ("--preset shapenet --object-split test", ("object_split", "test")),
        ("--preset shapenet --shapes box", ("source", "shapes")),
        ("--preset furniture-256", ("height", 16)),
    ],
)
def test_options_reach_the_request(run, monkeypatch, option, setting):
    """What `make_dataset` is asked for; nothing is rendered."""
    asked = []
    monkeypatch.setattr(
        "scenegen.rooms.make.make_dataset", lambda out, spec, *_, **__: asked.append(spec)
    )
    run("render", "--n", 1, "--size", 16, *shlex.split(option))
    assert json.loads(asked[0].to_json())[setting[0]] == setting[1]

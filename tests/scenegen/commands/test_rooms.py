"""Commands as a user types them: options reach the request, help tells defaults and examples."""

import json
import shlex
import sys

import click
import h5py
import pytest
import trimesh

import cli
from scenegen.description.presets import PATH_SAMPLES

SOME = "render --n 4 --out x.h5 --seed 3 --size 32x48 --shapes box,teapot --compression lzf"
TINY = ("--size", "32", "--min-visible-pixels", "3")


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
        ("--size 24", ("height", 24)),
        (f"--seed {2**63 - 1}", ("seed", 2**63 - 1)),
        ("--reflectance 0.2,0.3,0.4", ("room_reflectance", [0.2, 0.3, 0.4])),
        ("--views 0,5,35", ("views", [0, 5, 35])),
        ("--shading path --spp 1", ("shading", "path")),
        ("--shading path", ("spp", PATH_SAMPLES)),
        ("--specular 0.2-0.4", ("specular", [0.2, 0.4])),
        ("--preset specular --shininess 30", ("shininess", [30, 30])),
        ("--preset albedo --same-reflectance", ("random_reflectance", False)),
        ("--fov 20", ("fov_degrees", 20)),
        ("--classes mug,bowl", ("source", "families")),
        ("--classes 'mug, bowl'", ("shapes", ["mug", "bowl"])),
        ("--classes mug --object-split val", ("object_split", "val")),
        ("--preset shapenet --object-split test", ("object_split", "test")),
        ("--preset shapenet --shapes box", ("source", "shapes")),
        ("--preset shapenet --classes chair", ("shapes", ["chair"])),
        ("--preset random-lights", ("lights", [1, 5])),
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


@pytest.fixture(scope="module")
def options() -> dict[str, click.Option]:
    """Return the options of `scenegen render` by name."""
    command = cli.scenegen.get_command(click.Context(cli.scenegen), "render")
    return {p.name: p for p in command.params if isinstance(p, click.Option)}


def test_an_export_never_replaces_what_it_exports(run, refuses, rooms_path, tmp_path):
    (tmp_path / "meshes" / "mug").mkdir(parents=True)
    trimesh.creation.box((1, 2, 1)).export(tmp_path / "meshes" / "mug" / "x-000000.obj")
    meshes = ("--objects-root", "meshes")
    made = run("render", "--n", 1, *TINY, "--objects", 1, *meshes, "--out", "x.h5")
    assert made.exit_code == 0, made.output
    how = ("--items", 0, "--format", "obj", "--out", "meshes/mug", "--overwrite")
    refuses("export", "x.h5", *how, *meshes, words=("x-000000.obj", "not an input"))

"""Paths of commands: which outputs are refused for being inputs, however they are spelled."""

import os

import click
import pytest
from click.testing import CliRunner

from scenegen.command_line.groups import PackageCommands
from scenegen.command_line.options import MESH_FILES
from scenegen.command_line.paths import InputPath, OutputFolder, OutputPath, refuse_command_inputs


@click.command()
@click.argument("read", type=InputPath(within=MESH_FILES), nargs=-1)
@click.option("--weights", type=InputPath(beside=lambda path: [path.with_suffix(".json")]))
@click.option("--out", type=OutputPath())
@click.option("--json", type=OutputPath())
@click.option("--folder", type=OutputFolder())
@click.option("--derived")
def command(read, weights, out, json, folder, derived):
    refuse_command_inputs([derived] if derived else [])


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "meshes" / "mug").mkdir(parents=True)
    for name in ("a.h5", "b.h5", "w.safetensors", "w.json", "meshes/mug/1.obj", "meshes/x.json"):
        (tmp_path / name).touch()
    os.link("a.h5", "hard.h5")
    os.link("meshes/mug/1.obj", "hard.obj")
    os.link("meshes/mug/1.obj", "hard.json")
    os.symlink("a.h5", "soft.h5")
    os.symlink("meshes", "other")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("a.h5 --out a.h5", ("a.h5", "not an input")),
        ("--out a.h5 b.h5 a.h5", ("a.h5", "not an input")),
        ("a.h5 --out ./meshes/../a.h5", ("not an input",)),
        ("a.h5 --out hard.h5", ("hard.h5", "the input a.h5")),
        ("soft.h5 --json a.h5", ("a.h5", "the input soft.h5")),
        ("gone.h5 --out ./gone.h5", ("gone.h5",)),
        ("--out new --json ./new", ("outputs", "different paths")),
        ("--out b.h5 --json b.h5", ("outputs", "different paths")),
        ("--json new --folder ./new", ("outputs", "different paths")),
        ("--weights w.safetensors --out w.json", ("w.json",)),
        ("meshes --out meshes/mug/1.obj", ("1.obj", "the input meshes")),
        ("meshes --out hard.obj", ("hard.obj", "meshes")),
        ("--json hard.json meshes", ("hard.json", "meshes")),
        ("other --out meshes/mug/1.obj", ("1.obj", "the input other")),
        ("a.h5 --derived a.h5", ("a.h5",)),
        ("a.h5 --out ''", ("--out", "empty path")),
        ("''", ("READ", "empty path")),
        ("a.h5 --out b.h5", None),
        ("a.h5 a.h5 hard.h5 --out new --json new2 --derived b.h5", None),
        ("meshes --out meshes/x.json --json meshes/new.h5", None),
    ],
)
def test_an_output_is_no_input(files, check_refusal, line, words):
    group = PackageCommands("group", modules=())
    group.get_command = lambda ctx, name: command
    arguments = [word.strip("'") for word in f"command {line}".split()]
    done = CliRunner().invoke(group, arguments, catch_exceptions=False)
    if words is None:
        assert done.exit_code == 0, done.output
    else:
        check_refusal(done.exit_code, done.stdout, done.stderr, words)

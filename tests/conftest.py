"""Shared fixtures: tiny files, damaged copies, folders of meshes, the commands."""

import re
import shlex
import shutil
import signal
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from named_options import command_named, command_of, named_options

TINY = {"height": 32, "width": 32, "min_visible_pixels": 3, "seed": 3}


# Under nohup, or in the background of a shell, signals are ignored, which the processes of tests
# would inherit. Those that are handled here have their defaults there.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda *_: None)


@pytest.fixture(autouse=True, scope="session")
def _messages_name_options_that_there_are():
    """Look at all messages of commands that tests call: an option is one of the command.

    Or it is one of the last command that the message names before it, or was given.
    """
    invoke = CliRunner.invoke

    def looked_at(runner, group, args=None, **more):
        result = invoke(runner, group, args, **more)
        given = shlex.split(args) if isinstance(args, str) else list(args or ())
        for option, before in named_options(result.stderr):
            command = command_named(before) or command_of(group, given)
            known = {name for p in command.params for name in (*p.opts, *p.secondary_opts)}
            assert option in {*known, *given, "--help"}, result.stderr
        return result

    CliRunner.invoke = looked_at
    yield
    CliRunner.invoke = invoke


@pytest.fixture(autouse=True)
def _untried(request, monkeypatch):
    """Open files without a trial in another process, except where a test is marked `tried`.

    A trial takes 0.2 s, and most tests are about files that HDF5 can read.
    """
    if request.node.get_closest_marker("tried") is None:
        monkeypatch.setattr("scenegen.files.trial.try_file", lambda path: None)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory, monkeypatch):
    """Keep models in no folder but the tests' own, whatever an earlier test said."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))
    store = sys.modules.get("scenegen.objects.families.store")
    if store:
        store.MEMBER_STORE.use(None)


@pytest.fixture(scope="session")
def make_rooms():
    """Write a tiny file of rooms; settings override those of TINY, `how` goes to make_dataset."""
    from scenegen.description.specs import DatasetSpec
    from scenegen.rooms.make import make_dataset

    def make(path, count=6, how=None, **settings):
        spec = DatasetSpec(**{**TINY, **settings})
        make_dataset(path, spec, count, **{"command": "tests", **(how or {})})
        return path

    return make


@pytest.fixture(scope="session")
def rooms_path(make_rooms, tmp_path_factory):
    """Return a file of 8 rooms that no test changes."""
    return make_rooms(tmp_path_factory.mktemp("rooms") / "rooms.h5", 8)


@pytest.fixture(scope="session")
def interior_path(tmp_path_factory):
    """Return a file of one small closed room, seen once."""
    from scenegen.description.presets import preset_spec
    from scenegen.rooms.make import make_dataset

    path = tmp_path_factory.mktemp("interiors") / "x.h5"
    make_dataset(path, preset_spec("interiors", height=32, width=32, spp=1, objects=(4, 4)), 1)
    return path


@pytest.fixture(scope="session")
def float_path(make_rooms, tmp_path_factory):
    """Return a file of 5 rooms with float32 images, higher than wide."""
    path = tmp_path_factory.mktemp("rooms") / "float.h5"
    return make_rooms(path, 5, height=48, width=40, image_dtype="float32", min_visible_pixels=6)


@pytest.fixture
def damaged(rooms_path, tmp_path):
    """Return a function that copies the 8 rooms and lets `edit` at the copy."""

    def damage(edit):
        path = tmp_path / "damaged.h5"
        shutil.copy(rooms_path, path)
        with h5py.File(path, "r+") as file:
            edit(file)
        return path

    return damage


@pytest.fixture(scope="session")
def truths(tmp_path_factory):
    """Return the truths that submissions predict, `submissions.Truths`; no test changes them."""
    from submissions import make_truths

    return make_truths(tmp_path_factory.mktemp("truths"))


@pytest.fixture
def released(tmp_path):
    """Return a function that writes a file as released, with nothing but images and answers.

    Arguments: for each part its number of questions, and its answers or None. Options: of
    `create_dataset` for the questions.
    """

    def write(name="iqtt-val.h5", tables=None, dtype="float32", size=(20, 24), **options):
        rng = np.random.default_rng(3)
        with h5py.File(tmp_path / name, "w") as file:
            for part, (count, answers) in (tables or {"": (5, np.arange(5) % 3)}).items():
                images = rng.random((count, 4, *size, 3))
                values = np.rint(images * 255) if dtype == "uint8" else images
                group = file.require_group(part or "/")
                group.create_dataset("questions", data=values.astype(dtype), **options)
                if answers is not None:
                    group["answers"] = answers
        return tmp_path / name

    return write


@pytest.fixture
def meshes(tmp_path):
    """Return a folder of three mugs, one of them broken, and two bowls."""
    import trimesh

    root = tmp_path / "meshes"
    for name in ("mug", "bowl"):
        (root / name).mkdir(parents=True)
    trimesh.creation.box((1, 2, 1)).export(root / "mug" / "tall.obj")
    trimesh.creation.cylinder(1, 2).export(root / "mug" / "round.stl")
    (root / "mug" / "broken.obj").write_text("v 1 2 3\nv 4 5 6\n")
    trimesh.creation.icosphere(1).export(root / "bowl" / "ball.ply")
    trimesh.creation.cone(1, 1).export(root / "bowl" / "cone.off")
    return root


@pytest.fixture
def shapenet(tmp_path):
    """Return a folder laid out as ShapeNetCore version 2, with mugs and bowls."""
    import trimesh

    root = tmp_path / "shapenet"
    for synset in ("03797390", "02880940"):
        for i in range(3):
            path = root / synset / f"model{i}" / "models" / "model_normalized.obj"
            path.parent.mkdir(parents=True)
            trimesh.creation.box((1, 1 + i, 1)).export(path)
    return root


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run `scenegen ...` inside this process, in a folder of its own."""
    import cli

    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        command = [str(argument) for argument in arguments]
        return CliRunner().invoke(cli.scenegen, command, catch_exceptions=False)

    return call


def refusal(code, out, err, words=()):
    """Check that a command failed as the project promises; return its one line of error.

    Exit code 2, nothing on standard output, one line of error (after click's usage lines where it
    is click that complains), each of `words` in it, and no traceback.
    """
    assert "Traceback" not in err, err[-2000:]
    assert code == 2, f"exit code {code}: {out} {err}"
    assert out == ""
    lines = [line for line in err.splitlines() if line.strip()]
    if lines[0].startswith("Usage: "):
        lines = lines[[line[:5] for line in lines].index("Try '") + 1 :]  # long usage is wrapped
    assert len(lines) == 1, err
    assert lines[0].startswith("Error: ")
    assert [word for word in words if word not in lines[0]] == [], lines[0]
    return lines[0]


@pytest.fixture(scope="session")
def check_refusal():
    """Return `refusal`, for commands that a test started by itself."""
    return refusal


@pytest.fixture
def refuses(run, tmp_path):
    """Run a command that must fail as `refusal` says, and leave the disk as it was."""

    def call(*arguments, words=()):
        before = contents(tmp_path)
        result = run(*arguments)
        line = refusal(result.exit_code, result.stdout, result.stderr, words)
        assert contents(tmp_path) == before, "files were left or changed"
        return line

    return call


@pytest.fixture
def verdict(run):
    """Run verify; return exit code, "ok" or "FAIL" by name of the check, and the output."""

    def call(path, *options):
        result = run("verify", path, *options)
        lines = re.findall(r"^(ok|FAIL) +(\S+(?: \S+)*)", result.stdout, re.MULTILINE)
        return result.exit_code, {name: word for word, name in lines}, result.output

    return call


def contents(folder):
    """Return names and sizes of all that lies in a folder."""
    return {str(path): path.lstat().st_size for path in folder.rglob("*")}


@pytest.fixture(scope="session")
def pix2shape_files(truths, make_rooms, tmp_path_factory):
    """Return a folder of rooms, questions and weights that no test changes."""
    pytest.importorskip("torch")
    from pix2shape_commands import prepare

    folder = tmp_path_factory.mktemp("pix2shape")
    return prepare(folder, Path(truths.rooms), Path(truths.iqtt), make_rooms)

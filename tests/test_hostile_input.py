"""Any file is read or refused: in one printable line, soon, in little memory, and left as it was.

An edit is drawn from those that once found faults: of values, types, storage and links in HDF5, of
values in JSON, of bytes. Which fault is named how is tested beside each reader.
"""

import json
import os
import resource
import shutil
import signal
from contextlib import contextmanager
from pathlib import Path

import h5_edits
import h5py
import made_scores
import numpy as np
import OpenEXR
import pytest
import submissions
import trimesh
from click.testing import CliRunner
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from json_edits import GONE, changed, every_place
from PIL import Image
from pix2shape_models import tiny, written

import cli
from baselines.pix2shape.weights import open_weights
from iqtt import open_questions
from metrics.intake.answers.answer_files import import_answers
from metrics.intake.answers.quiz_answers import read_answers
from metrics.intake.array_files import read_array
from metrics.intake.truth_layouts import nyu
from metrics.measured.describe import describe
from metrics.measured.reader import MeasuredFile
from metrics.measured.writer import Measured, Source, write_measured
from metrics.score_file import read_scores, write_scores
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen import open_rooms
from scenegen.camera import intrinsics
from scenegen.common.errors import SceneGenError
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.read import parse_mesh, read_bytes

SECONDS, MEMORY = 20, 2**30  # that a tiny file may take, on a busy machine
MESHES = ("box.obj", "cone.off", "ring.glb", "ball.ply", "text.ply", "cylinder.stl", "text.stl")
IMAGES = ("x.npy", "x.npz", "x.png", "x.tiff", "x.exr", "x.pfm")


@pytest.fixture(scope="module")
def honest(truths, tmp_path_factory):
    """Return a folder of files that are read without complaint, of every kind."""
    folder = tmp_path_factory.mktemp("honest")
    shutil.copy(truths.rooms, folder)
    for path in truths.iqtt.parent.glob("*.h5"):
        shutil.copy(path, folder)
    submissions.good_rooms(folder, folder / "rooms.h5")
    submissions.good_answers(folder, folder / "iqtt-test.h5")
    write_scores(made_scores.rooms_with_objects(), folder / "scores.json")
    write_scores(made_scores.rooms_with_objects("other"), folder / "other.json")
    given = {"question": 3, "answer": 1, "seconds": 2.5, "times_shown": 1}
    practice = [{"answer": 0, "seconds": 1.5, "times_shown": 2}]
    quiz = {"format": "pix2shape-bench/quiz-answers", "format_version": "1.0", "digest": "0" * 64}
    quiz |= {"quiz": "1" * 16, "participant": "2" * 16, "answers": [given], "practice": practice}
    (folder / "people.json").write_text(json.dumps(quiz))
    written(folder / "weights.safetensors", tiny())
    (folder / "answers.json").write_text('{"answers": {"0": 1, "5": 2}, "method": "mine"}')
    (folder / "answers.csv").write_text("question,answer\n" + "".join(f"{i},A\n" for i in range(6)))
    depth = np.linspace(1, 2, 48, dtype="f4").reshape(6, 8)
    np.save(folder / "x.npy", depth)
    np.savez(folder / "x.npz", depth=depth)
    for name in ("x.png", "x.tiff"):
        Image.fromarray((1000 * depth).astype("u2")).save(folder / name)
    (folder / "x.pfm").write_bytes(b"Pf\n8 6\n-1.0\n" + depth.tobytes())
    OpenEXR.File({}, {"Z": depth}).write(str(folder / "x.exr"))
    image = np.zeros((6, 8, 3), np.uint8)
    measured = Measured(image, depth, intrinsics(6, 8, 60.0, pixel_centers="half"), image + 1.0)
    rows = [Source(f"{i}.png", "a", (6, 8), lambda: measured) for i in range(3)]
    write_measured(folder / "measured.h5", rows, source="tests", licence="")
    with h5py.File(folder / "nyu.mat", "w") as file:
        file["images"], file["depths"] = image.T[None], depth.T[None]
        file["scene"] = np.frombuffer(b"kitchen", np.uint8).astype("u2")
        file["scenes"] = np.array([[file["scene"].ref]], h5py.ref_dtype)
    ball, ring = trimesh.creation.icosphere(1), trimesh.creation.annulus(0.5, 1, 1, sections=8)
    ball.export(folder / "ball.ply")
    ball.export(folder / "text.ply", encoding="ascii")
    ring.export(folder / "ring.glb")
    ring.export(folder / "cylinder.stl")
    ring.export(folder / "text.stl", file_type="stl_ascii")
    trimesh.creation.box().export(folder / "box.obj")
    trimesh.creation.cone(1, 1, sections=8).export(folder / "cone.off")
    return folder


def read(path):
    """Read everything of a file, by its honest name; return the lines that say what is wrong."""
    name = path.name
    if name in MESHES:
        mesh = clean_mesh(*parse_mesh(read_bytes(path), path.suffix))
        assert np.isfinite(mesh.vertices).all()
        assert len(mesh.faces)
    elif name in IMAGES:
        assert read_array(path).dtype.kind in "uif"
    elif name == "rooms.h5":
        with open_rooms(path) as rooms:
            list(rooms)
    elif name == "measured.h5":
        describe(path)
        with MeasuredFile(path) as truth:
            for row in range(len(truth)):
                assert truth.view(row).mask.any()
                assert truth.picture(row).shape[:2] == truth.size(row)
    elif name == "nyu.mat":
        new = path.parent / "new.h5"
        write_measured(new, nyu(path, None), source="", licence="", overwrite=True)
    elif name.startswith("iqtt-"):
        with open_questions(path) as questions:
            list(questions)
    elif name == "people.json":
        read_answers(path)
    elif name == "scores.json":
        read_scores(path)
    elif name == "answers.csv":
        import_answers(path, path.parent / "iqtt-test.h5", path.parent / "new.h5", method="mine")
    elif name == "weights.safetensors":
        open_weights(path)
    else:
        truth = path.parent / ("rooms.h5" if name == "predictions.h5" else "iqtt-test.h5")
        with open_predictions(path):
            return [str(problem) for problem in validate(path, truth)]
    return []


@contextmanager
def bounded():
    """Allow little time and memory to what is done meanwhile."""

    def late(*_):
        raise AssertionError("it takes too long")

    held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    limits = resource.getrlimit(resource.RLIMIT_DATA)
    handler = signal.signal(signal.SIGALRM, late)
    resource.setrlimit(resource.RLIMIT_DATA, (held + MEMORY, limits[1]))
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_DATA, limits)


def state(path):
    """Return what changes with a file's content, and nothing that changes when it is read."""
    found = path.lstat() if path.is_symlink() or path.exists() else None
    return found and (found.st_mode, found.st_ino, found.st_size, found.st_mtime_ns)


def is_read_or_refused(path):
    before = state(path)
    with bounded():
        try:
            lines = read(path)
        except (SceneGenError, OSError) as error:
            lines = [str(error)]
    assert all(line.isprintable() and len(line) < 2000 for line in lines), lines
    assert state(path) == before


TEXTS = ("", " \u00a0", "-1", "9" * 400, "nan", "\x1b[2J", "mine\nError: yours", "\u202e.h5",
         "a\u0301" * 5000, "../../etc/passwd", "m" * 200_000, "%s%n{0}{x!r}", "[" * 20_000,
         "0" * 64, '{"a": [1, null]}')  # fmt: skip
NUMBERS = (0, -1, 1, 2**31, 2**53 + 1, 2**63, 0.5, -0.0, 9e99, 1e308, np.nan, np.inf, -np.inf)
ODD = (h5py.Empty("f4"), np.bytes_(b"\xff\xfe\x80"), True, 1 + 2j, ["one", "two\x1b[1m"],
       np.arange(12.0).reshape(3, 4), np.zeros((0, 3)), np.zeros(7000), h5py.Reference(),
       np.array((1, 2.0), [("a", "i4"), ("b", "f8")]), np.void(b"\x01\x02"),
       np.array(7, h5py.enum_dtype({"a": 0, "b": 7}, "i4")))  # fmt: skip
JSON = (None, True, [], {}, [[[]]], [None], {"value": 1}, -1, 0.5, 10**30, "x", "\ud800", "\x1b[2J",
        "m" * 9999, float("nan"), float("inf"), GONE)  # fmt: skip
ARRAYS = (
    *(lambda v, kind=kind: v.astype(kind) for kind in ("f2", "f8", ">f4", "i1", "u8", "?", "c8")),
    lambda v: np.full(v.shape, "far", object), lambda v: np.zeros(v.shape, [("z", "f4")]),
    lambda v: v[:0], lambda v: v[:1], lambda v: np.concatenate([v, v]), lambda v: v[::-1],
    lambda v: v[None], lambda v: v[..., 0], lambda v: np.moveaxis(v, 0, -1), lambda v: v.ravel(),
)  # fmt: skip
LINKS = ("itself", "/nowhere", "/", "image", ("pipe.h5", "/x"), ("/dev/zero", "/x"))
STORED = (
    lambda v: {"external": [("/etc/passwd", 0, v.nbytes)]},
    lambda v: {"external": [("pipe.h5", 0, v.nbytes)]},
    lambda v: {"chunks": (1, *v.shape[1:])},
    lambda v: {"shape": (2**40, *v.shape[1:]), "chunks": (1, *v.shape[1:])},
    lambda v: {"data": v, "chunks": (1,) * v.ndim},
    lambda v: {"data": v, "compression": "gzip", "shuffle": True, "fletcher32": True},
    lambda v: {"maxshape": (None, *v.shape[1:]), "chunks": (2**22, *v.shape[1:]),
               "compression": "gzip"},
)  # fmt: skip


def edit_hdf5(path, draw):
    """Change one attribute or data set."""
    with h5py.File(path, "r+", libver="latest") as file, np.errstate(all="ignore"):
        holders = ["/"]
        file.visit(holders.append)
        arrays = [name for name in holders if isinstance(file[name], h5py.Dataset)]
        arrays = [name for name in arrays if h5py.check_ref_dtype(file[name].dtype) is None]
        name = draw(st.sampled_from(arrays))
        act = draw(st.sampled_from(["attribute", "value", "array", "gone", "link", "stored"]))
        if act == "attribute":
            notes = file[draw(st.sampled_from(["/", *holders]))].attrs
            key = draw(st.sampled_from([*notes, "more"]))
            value = draw(st.sampled_from([*TEXTS, *NUMBERS, *ODD, *JSON[-1:]]))
            notes.pop(key, None)
            if value is not GONE:
                notes.create(key, value)
        elif act == "value" and file[name].dtype.kind in "fiu" and file[name].size:
            number = np.array(draw(st.sampled_from(NUMBERS)), "f8")
            row = draw(st.integers(0, len(file[name]) - 1))
            file[name][row] = np.nan_to_num(number).astype(file[name].dtype)
            if file[name].dtype.kind == "f":
                file[name][row] = number
        elif act == "array" and file[name].ndim:
            notes = dict(file[name].attrs)
            h5_edits.replaced(name, draw(st.sampled_from(ARRAYS)))(file)
            file[name].attrs.update({k: v for k, v in notes.items() if "DIM" not in k})
        elif act == "link":
            to = draw(st.sampled_from(LINKS))
            soft = h5py.SoftLink(name if to == "itself" else to)
            link = h5py.ExternalLink(*to) if isinstance(to, tuple) else soft
            h5_edits.linked(name, file["/"] if to == "/" else link)(file)
        elif act == "stored" and file[name].ndim:
            values = file[name][()]
            del file[name]
            how = {"shape": values.shape, "dtype": values.dtype}
            file.create_dataset(name, **{**how, **draw(st.sampled_from(STORED))(values)})
        else:
            del file[name]


def edit_json(path, draw):
    """Change one value, or what stands around all."""
    content = json.loads(path.read_text())
    place = draw(st.sampled_from(list(every_place(content))))
    text = json.dumps(changed(content, place, draw(st.sampled_from(JSON))))
    frames = [text, "\ufeff" + text, text + text, "// mine\n" + text, " " * 10**6 + text]
    path.write_text(draw(st.sampled_from([text, *frames])))


def edit_bytes(path, draw):
    """Change some bytes, cut or repeat a part, or go on with another file."""
    data = path.read_bytes()
    first, last = sorted(int(len(data) * draw(st.floats(0, 1)) ** 4) for _ in range(2))
    part = draw(st.sampled_from([b"", data[first:last] * 3, b"\xff\xff\xff\x7f", bytes(8), b"nan",
                                 b"9" * 30, b"1e999", b"-1", b"\x1b[2J"]))  # fmt: skip
    end = draw(st.sampled_from([last, first + len(part), len(data)]))
    path.write_bytes(data[:first] + part + data[end:])


READ = ("rooms.h5", "iqtt-val.h5", "measured.h5", "nyu.mat", "predictions.h5", "answers.h5",
        "scores.json", "answers.json", "answers.csv", "people.json", "weights.safetensors", *MESHES,
        *IMAGES)  # fmt: skip


@pytest.fixture
def folder(honest, tmp_path, monkeypatch):
    """Return a folder with the files that others name, and with a pipe that nobody writes to."""
    for path in honest.iterdir():
        shutil.copy(path, tmp_path)
    os.mkfifo(tmp_path / "pipe.h5")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("name", READ)
def test_whatever_is_edited(name, honest, folder):
    path = folder / name
    edit = {".h5": edit_hdf5, ".mat": edit_hdf5, ".json": edit_json}.get(path.suffix, edit_bytes)

    @settings(max_examples=100, deadline=None, derandomize=True, database=None,
              phases=[Phase.generate], suppress_health_check=list(HealthCheck))  # fmt: skip
    @given(st.data())
    def holds(data):
        shutil.copy(honest / name, path)
        (folder / "new.h5").unlink(missing_ok=True)
        edit(path, data.draw)
        is_read_or_refused(path)

    shutil.copy(honest / name, path)
    assert read(path) == [] or path.suffix == ".json"
    holds()


INSTEAD = {
    "nothing": lambda path: None,
    "an empty file": lambda path: path.touch(),
    "text": lambda path: path.write_text("depth,1,2,3\n" * 99),
    "a gigabyte": lambda path: (path.touch(), os.truncate(path, 2**30)),
    "a folder": lambda path: path.mkdir(),
    "a pipe": os.mkfifo,
    "a link to nothing": lambda path: path.symlink_to("nowhere"),
    "a link to itself": lambda path: path.symlink_to(path.name),
}


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=[pytest.mark.slow] * (k == "a gigabyte")) for k in INSTEAD]
)
def test_whatever_lies_in_its_place(kind, folder):
    for name in READ:
        path = folder / name
        path.unlink(missing_ok=True)
        INSTEAD[kind](path)
        is_read_or_refused(path)


# Commands that once ended otherwise than with one line: the command, and edits of its files.
COMMANDS = {
    "bench score predictions.h5 --truth rooms.h5": {
        "depth behind the camera": ("rooms.h5", h5_edits.put("depth", 1, -1)),
        "infinite depth": ("rooms.h5", h5_edits.put("depth", 1, np.inf)),
        "normals of NaN": ("rooms.h5", h5_edits.put("normal", 1, np.nan)),
        "far depth": ("predictions.h5", h5_edits.replaced("depth", lambda v: v + np.float64(9e99))),
    },
    "bench score answers.h5 --truth iqtt-test-answers.h5": {
        "kind": ("iqtt-test-answers.h5", h5_edits.values("truth/distractor_kind", lambda v: v + 99))
    },
    "iqtt audit iqtt-val.h5": {
        "circle": ("iqtt-val.h5", lambda file: h5_edits.linked("truth/cubes", file["/"])(file))
    },
    "scenegen info rooms.h5": {
        "circle": ("rooms.h5", lambda file: h5_edits.linked("depth", file["/"])(file)),
        "version": ("rooms.h5", h5_edits.attribute("format_version", "1" * 200_000)),
    },
}
COMMANDS |= {
    command: {"": ("rooms.h5", lambda file: None)}
    for command in (
        "bench score predictions.h5 --truth rooms.h5 --json rooms.h5 --overwrite",
        "bench score predictions.h5 --truth rooms.h5 --json hard.h5 --overwrite",
        "bench score predictions.h5 --truth rooms.h5 --csv soft.h5 --overwrite",
        "bench score answers.h5 --truth iqtt-test-answers.h5 --csv loop",
        "bench baseline oracle --data rooms.h5 a\nb",
        "scenegen preview rooms.h5 --out rooms.h5",
        "scenegen preview rooms.h5 --out \udcff.png",
        "scenegen info \x1b[2J.h5",
        "scenegen check-objects . --json new --cache-dir new",
    )
}


@pytest.mark.parametrize(
    ("command", "edit"),
    [pytest.param(c, e, id=f"{c!a:.60} {n}") for c, es in COMMANDS.items() for n, e in es.items()],
)
def test_commands_refuse_in_one_line(command, edit, folder, check_refusal):
    name, change = edit
    with h5py.File(folder / name, "r+") as file:
        change(file)
    os.link(folder / "rooms.h5", folder / "hard.h5")
    (folder / "soft.h5").symlink_to("rooms.h5")
    (folder / "loop").symlink_to("loop")
    before = {path: state(path) for path in folder.rglob("*")}
    program, *arguments = command.split(" ")
    done = CliRunner().invoke(getattr(cli, program), arguments)
    line = check_refusal(done.exit_code, done.stdout, done.stderr)
    assert line.isprintable()
    assert {path: state(path) for path in folder.rglob("*")} == before

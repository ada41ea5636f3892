"""Splits as wholes: the same request, the same bytes; odd requests; runs that end early."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from iqtt.files import make as module
from iqtt.files.make import FILES, make_split, make_suite
from iqtt.files.reader import QuestionsFile
from iqtt.questions.specs import SUITE, SplitSpec, preset_spec, question_kind
from iqtt.shapes.splits import TooFewShapesError
from scenegen.common.errors import PlacementError, SpecError
from scenegen.common.workspace import remove_leftovers
from scenegen.rendering.backend import versions

ENDS = ("little", "big")
SECRET = 8_123_456_789_012_345
SPEC = SplitSpec(
    seed=SECRET, train=7, labeled=3, val=4, test=5, cubes=(6, 7), height=24, width=32,
    min_cube_pixels=1, lights=(1, 2),
)  # fmt: skip
COMMAND = f"iqtt make-split --seed {SECRET}"
AGAIN = """
import sys
from iqtt.questions.specs import SplitSpec
from iqtt.files.make import make_split
make_split(sys.argv[1], SplitSpec.from_json(sys.argv[2]), batch=3, command=sys.argv[3])
"""
KILLED = """
import os, signal, sys
from iqtt.questions.specs import SplitSpec
from iqtt.files.make import make_split
kill = lambda done: os.kill(os.getpid(), signal.SIGKILL)
make_split(sys.argv[1], SplitSpec.from_json(sys.argv[2]), batch=1, overwrite=True, progress=kill)
"""
TINY = SplitSpec(
    seed=1, train=3, labeled=2, val=2, test=2, cubes=(6, 6), height=16, width=16, min_cube_pixels=0
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "split"
    tally = make_split(folder, SPEC, command=COMMAND)
    assert tally.proposed - tally.refused >= 4 * 16
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_nothing_handed_out_tells_the_test_answers(folder):
    """No seed, no command, no truth; and no bytes that follow from the answers but a hash of much
    more than them.
    """
    with h5py.File(folder / "iqtt-test.h5") as file:
        assert list(file) == ["questions"]
        assert set(file.attrs) == {
            "format", "format_version", "writer", "variant", "spec", "task", "conventions", "split",
            "fingerprint", "content_digest", *versions(),
        }  # fmt: skip
        assert {name: file.attrs[name] for name in versions()} == versions()
        assert set(file["questions"].attrs) == {
            "unit", "shape", "frame", "meaning", "scale", "sha256",
        }  # fmt: skip
        assert re.fullmatch("[0-9a-f]{64}", file.attrs["fingerprint"])
    with h5py.File(folder / "iqtt-test-answers.h5") as file:
        assert file.attrs["creation_command"] == COMMAND
    for name, raw in contents(folder).items():
        secret = "answers" in name
        assert (str(SECRET).encode() in raw) == secret
        assert (SECRET.to_bytes(8, "little") in raw) is False
        assert (b"creation_command" in raw) == secret


def test_a_secret_seed_is_in_no_file(folder, tmp_path):
    """Nor anything that follows from it but the questions; these are those of any seed."""
    make_split(tmp_path / "secret", SPEC, command="iqtt make-split", secret=True)
    for name, raw in contents(tmp_path / "secret").items():
        for seed in (str(SECRET).encode(), *(SECRET.to_bytes(8, order) for order in ENDS)):
            assert seed not in raw, name
        if "answers" not in name:
            assert raw == (folder / name).read_bytes()
    with (
        h5py.File(folder / "iqtt-test-answers.h5") as told,
        h5py.File(tmp_path / "secret" / "iqtt-test-answers.h5") as file,
    ):
        assert SplitSpec.from_json(file.attrs["spec"]) == SPEC.public()
        assert file["answers"][:].tobytes() == told["answers"][:].tobytes()
        assert file.attrs["fingerprint"] == told.attrs["fingerprint"]


def test_the_same_request_gives_the_same_bytes(folder, tmp_path):
    """In another process, in batches of another size."""
    command = [sys.executable, "-c", AGAIN, str(tmp_path / "again"), SPEC.to_json(), COMMAND]
    subprocess.run(command, check=True, capture_output=True)
    assert contents(tmp_path / "again") == contents(folder)
    assert os.listdir(tmp_path) == ["again"]


def test_a_table_does_not_depend_on_the_size_of_the_others(folder, tmp_path):
    """Fingerprints, which hold all settings, apart."""
    make_split(tmp_path / "changed", replace(SPEC, val=1, test=0, labeled=3, train=3))
    with (
        h5py.File(folder / "iqtt-train.h5") as a,
        h5py.File(tmp_path / "changed" / "iqtt-train.h5") as b,
    ):
        for name in ("questions", "answers"):
            assert a["labeled"][name][:].tobytes() == b["labeled"][name][:].tobytes()
        for name, values in a["truth/labeled"].items():
            assert values[:].tobytes() == b["truth/labeled"][name][:].tobytes()
        assert b["unlabeled/questions"].shape == (0, 4, 24, 32, 3)
        assert a.attrs["fingerprint_labeled"] != b.attrs["fingerprint_labeled"]


def listing(folder: Path) -> dict[str, bytes | None]:
    """All there is in a folder, hidden names too."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "split"
    make_split(folder, TINY)
    return folder


@pytest.fixture
def old(made: Path, tmp_path: Path) -> Path:
    """The folder of an older split."""
    folder = tmp_path / "old"
    folder.mkdir()
    for name, raw in listing(made).items():
        (folder / name).write_bytes(raw)
    return folder


@pytest.mark.parametrize(
    "changed",
    [
        {"cubes": (16, 16), "shapes": "tree", "train": 1, "labeled": 0},
        {"cubes": (12, 12), "distractors": "mirror", "test": 0},
        {"height": 24, "width": 40, "min_angle_degrees": 90},
        {"height": 40, "width": 24, "lights": (1, 4)},
        {"max_radius": 10},
        {"cubes": (5, 6), "max_radius": 2.2, "distractors": "other"},
        {"cubes": (5, 5), "distractors": "other"},
        {"seed": 2**63 - 1, "background": (0, 0, 0)},
        {"labeled": 3, "val": 6},
        {"labeled": 0},
        {"train": 0, "labeled": 0, "val": 0, "test": 5},
    ],
)
def test_odd_requests_are_answered_in_full(changed, tmp_path):
    spec = replace(TINY, **changed)
    done = []
    make_split(tmp_path / "split", spec, batch=1, progress=done.append)
    assert sum(done) == spec.train + spec.val + spec.test
    sizes = {
        "iqtt-train.h5": {"labeled/": spec.labeled, "unlabeled/": spec.train - spec.labeled},
        "iqtt-val.h5": {"": spec.val},
        "iqtt-test.h5": {"": spec.test},
    }
    for name, groups in sizes.items():
        with h5py.File(tmp_path / "split" / name) as file:
            for group, count in groups.items():
                images = file[group + "questions"]
                assert images.shape == (count, 4, spec.height, spec.width, 3)
                raw = {image.tobytes() for image in images[:].reshape(-1, *images.shape[2:])}
                assert len(raw) == 4 * count, "all images differ"
                if f"{group}answers" in file:
                    counts = np.bincount(file[f"{group}answers"][:], minlength=3)
                    assert np.ptp(counts) <= 1


@pytest.mark.parametrize(
    ("compression", "dtype"), [("none", "float16"), ("lzf", "float32"), ("gzip", "uint8")]
)
def test_plain_h5py_reads_every_type_and_compression(compression, dtype, made, tmp_path):
    spec = replace(TINY, image_dtype=dtype, with_depth=True)
    make_split(tmp_path / "split", spec, compression=compression)
    for name, path in (("iqtt-train.h5", "unlabeled/questions"), ("iqtt-val.h5", "questions")):
        with h5py.File(made / name) as plain, h5py.File(tmp_path / "split" / name) as file:
            images = file[path]
            assert images.dtype == dtype
            assert images.compression == (None if compression == "none" else compression)
            assert images.attrs["scale"] == (1 / 255 if dtype == "uint8" else 1)
            radiance = images[:] * images.attrs["scale"]
            assert radiance.min() >= 0
            assert radiance.max() == 1
            assert abs(radiance - plain[path][:] / 255).max() < 0.6 / 255
            truth = file["truth" if name == "iqtt-val.h5" else "truth/unlabeled"]
            assert truth["depth"].attrs["unit"] == "cube edge"
            surface = np.isfinite(truth["depth"][:])
            assert (radiance[~surface] == 1).all()
            middle = truth["camera_distance"][:][:, None, None, None]
            assert (abs(truth["depth"][:] - middle)[surface] < spec.max_radius).all()
    with h5py.File(tmp_path / "split" / "iqtt-test.h5") as file:
        assert list(file) == ["questions"]
    with h5py.File(tmp_path / "split" / "iqtt-test-answers.h5") as file:
        assert file["truth/depth"].shape == (2, 4, 16, 16)


def test_an_older_split_is_replaced_only_on_request(old, tmp_path):
    before = listing(tmp_path)
    with pytest.raises(FileExistsError):
        make_split(old, replace(TINY, seed=2))
    assert listing(tmp_path) == before
    (old / "iqtt-val.h5").unlink()
    beside = set()
    look = lambda _: beside.update(os.listdir(tmp_path))  # noqa: E731
    make_split(old, replace(TINY, seed=2), overwrite=True, progress=look)
    assert len(beside) == 2, "the new one is made beside the old one"
    after = listing(tmp_path)
    assert set(after) == set(before)
    assert all(after[f"old/{name}"] != before[f"old/{name}"] for name in FILES)


def test_the_folder_that_one_is_in_is_filled_where_it_is(old, tmp_path, monkeypatch):
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    make_split(".", TINY, overwrite=True)
    assert listing(Path()) == listing(old)


def test_a_killed_run_is_in_nobody_s_way(old, tmp_path):
    """Killed while it makes the split, and then started again."""
    command = [sys.executable, "-c", KILLED, old, replace(TINY, seed=2).to_json()]
    for folder in (old, tmp_path / "new"):
        before = listing(old)
        command[3] = str(folder)
        assert subprocess.run(command, check=False, capture_output=True).returncode == -9
        assert listing(old) == before
        assert len(os.listdir(tmp_path)) == 2, "the split and what the killed run left"
        with pytest.warns(UserWarning, match="partial"):
            remove_leftovers(tmp_path)
        make_split(folder, replace(TINY, seed=2), overwrite=True)
        assert sorted(os.listdir(folder)) == sorted(FILES)


@pytest.mark.parametrize(
    "stranger", ["notes.txt", "iqtt-test-predictions.h5", ".hidden", "iqtt-train.h5/"]
)
def test_a_folder_with_other_things_is_never_replaced(stranger, old, tmp_path):
    if stranger.endswith("/"):
        (old / stranger).unlink()
        (old / stranger).mkdir()
    else:
        (old / stranger).write_text("mine")
    before = listing(tmp_path)
    with pytest.raises(FileExistsError) as error:
        make_split(old, TINY, overwrite=True)
    assert stranger.rstrip("/") in str(error.value.strerror)
    assert error.value.filename == str(old)
    assert listing(tmp_path) == before


def test_places_that_cannot_be_a_folder_are_refused_before_anything_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "make_pools", None)
    (tmp_path / "file").write_text("mine")
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    before = listing(tmp_path)
    for overwrite in (False, True):
        for name, kind in (
            ("file", NotADirectoryError),
            ("file/split", NotADirectoryError),
            ("missing/split", FileNotFoundError),
            ("nowhere", OSError),
        ):
            with pytest.raises(kind):
                make_split(tmp_path / name, TINY, overwrite=overwrite)
    (tmp_path / "locked").mkdir()
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    for path in ("locked", "locked/split"):
        with pytest.raises(PermissionError) as error:
            make_split(tmp_path / path, TINY, overwrite=True)
        assert error.value.filename == str(tmp_path / "locked")
    del before["file"]
    assert set(listing(tmp_path)) == {*before, "file", "locked"}


class StopError(Exception):
    """What the test's progress bar raises."""


@pytest.mark.parametrize("kind", [StopError, KeyboardInterrupt])
@pytest.mark.parametrize("after", [1, 7])
def test_an_interrupted_run_leaves_all_as_it_was(kind, after, old, tmp_path):
    done = []

    def progress(count: int) -> None:
        done.append(count)
        if sum(done) >= after:
            raise kind

    before = listing(tmp_path)
    for folder in (tmp_path / "new", old):
        done.clear()
        with pytest.raises(kind):
            make_split(folder, replace(TINY, seed=2), batch=1, progress=progress, overwrite=True)
        assert listing(tmp_path) == before


def test_errors_on_the_way_leave_all_as_it_was(old, tmp_path, monkeypatch):
    before, new = listing(tmp_path), tmp_path / "new"
    with pytest.raises(SpecError):
        make_split(new, TINY, compression="zip")
    with pytest.raises(TooFewShapesError):
        make_split(new, replace(TINY, cubes=(3, 3)))
    monkeypatch.setattr("iqtt.questions.views.QUESTION_ATTEMPTS", 1)
    monkeypatch.setattr("iqtt.questions.views.VIEWS", 1)
    with pytest.raises(PlacementError):
        make_split(old, replace(TINY, height=64, width=64, min_cube_pixels=14), overwrite=True)
    monkeypatch.undo()
    monkeypatch.setattr(os, "statvfs", lambda path: SimpleNamespace(f_bavail=0, f_frsize=1))
    with pytest.raises(OSError, match="No space left on device") as error:
        make_split(new, TINY)
    assert error.value.filename == str(new / "iqtt-train.h5")
    monkeypatch.undo()
    with pytest.raises(FileExistsError):  # somebody else makes the folder meanwhile
        make_split(new, TINY, progress=lambda count: new.mkdir(exist_ok=True))
    new.rmdir()
    assert listing(tmp_path) == before


def as_released(path: Path) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Load images and answers as whoever has the released files does: with plain h5py, by the
    names and types that their description tells.
    """
    tables = []
    with h5py.File(path) as file:
        for group in (file["labeled"], file["unlabeled"]) if "labeled" in file else (file,):
            images = group["questions"][()]
            assert (images.dtype, images.ndim) == (np.float32, 5)
            assert images.shape[1:] == (4, 32, 32, 3)
            assert 0 <= images.min() < 0.5 < images.max() <= 1
            answers = group["answers"][()] if "answers" in group else None
            assert answers is None or (answers.dtype, answers.shape) == (np.uint8, images.shape[:1])
            tables.append((images, answers))
    return tables


def test_the_preset_v2_takes_the_place_of_the_released_files(tmp_path):
    spec = preset_spec("v2", train=9, labeled=6, val=6, test=3, height=32, width=32)
    make_split(tmp_path / "v2", spec)
    labeled, unlabeled = as_released(tmp_path / "v2" / "iqtt-train.h5")
    [val], [test] = (as_released(tmp_path / "v2" / f"iqtt-{name}.h5") for name in ("val", "test"))
    assert [len(images) for images, _ in (labeled, unlabeled, val, test)] == [6, 3, 6, 3]
    assert unlabeled[1] is test[1] is None
    assert sorted(labeled[1]) == sorted(val[1]) == [0, 0, 1, 1, 2, 2]
    for images, _ in (labeled, unlabeled, val, test):
        assert (images[:, :, 0, 0] == 1).all(), "the background is white"
        assert len(np.unique(images)) > 256, "more than bytes"


SUITE_SPEC = replace(TINY, cubes=(9, 9), train=2, labeled=1, val=2, test=1)


def test_the_suite_has_a_split_of_each_kind_in_a_folder_of_its_own(tmp_path):
    done: list[int] = []
    tally = make_suite(tmp_path / "suite", SUITE_SPEC, progress=done.append, compression="none")
    assert sorted(os.listdir(tmp_path / "suite")) == sorted(SUITE)
    assert (sum(done), tally.proposed > 5 * 6 * 3) == (5 * 6, True)
    for name, (kind, answers) in SUITE.items():
        with QuestionsFile(tmp_path / "suite" / name / "iqtt-val.h5") as questions:
            expected = replace(SUITE_SPEC, seed=None, distractors=kind, answers=answers)
            assert questions.spec == expected
            kinds = questions.read("distractor_kind", slice(None))
            assert {question_kind(row) for row in kinds.tolist()} == {name}
            assert questions.read("questions", 0).shape == (1 + answers, 16, 16, 3)
        with h5py.File(tmp_path / "suite" / name / "iqtt-train.h5") as file:
            assert file["unlabeled/questions"].compression is None
    with pytest.raises(FileExistsError):
        make_suite(tmp_path / "suite", SUITE_SPEC)


def test_a_suite_that_is_stopped_leaves_whole_splits_and_goes_over_none(tmp_path):
    done: list[int] = []

    def stop(count: int) -> None:
        done.append(count)
        if sum(done) > 7:
            raise StopError

    for folder in ("suite", "suite"):
        done.clear()
        with pytest.raises(StopError):
            make_suite(tmp_path / folder, SUITE_SPEC, progress=stop, overwrite=True)
        assert listing(tmp_path).keys() == {
            *("suite", "suite/matched", *(f"suite/matched/{name}" for name in FILES))
        }
    before = listing(tmp_path)
    (tmp_path / "file").write_text("mine")
    for folder, error in (("suite", FileExistsError), ("file", NotADirectoryError)):
        with pytest.raises(error):
            make_suite(tmp_path / folder, SUITE_SPEC, progress=done.append)
    with pytest.raises(TooFewShapesError):
        make_suite(tmp_path / "new", replace(SUITE_SPEC, cubes=(6, 6)))
    with pytest.raises(FileNotFoundError):
        make_suite(tmp_path / "no" / "new", SUITE_SPEC)
    (tmp_path / "file").unlink()
    assert listing(tmp_path) == before


def test_a_split_without_any_question_is_refused(tmp_path):
    with pytest.raises(SpecError) as error:
        make_split(tmp_path / "empty", SplitSpec(train=0, labeled=0, val=0, test=0))
    assert error.value.where == "train, val and test"
    assert error.value.expected == "at least 1 question in all"
    assert list(tmp_path.iterdir()) == []

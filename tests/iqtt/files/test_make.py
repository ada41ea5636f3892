"""Splits and their files: the released layout, odd requests, folders and suites."""

import hashlib
import os
import re
from dataclasses import replace

import h5py
import numpy as np
import pytest
from made_splits import TINY, StopError, listing
from polycubes import are_congruent

from iqtt.files import work
from iqtt.files.make import make_split
from iqtt.files.reader import QuestionsFile
from iqtt.files.split import ALL_FILES
from iqtt.files.split import ALL_FILES as FILES
from iqtt.questions.distractors import make_pools
from iqtt.questions.kinds import question_kind
from iqtt.questions.specs import SUITE, SplitSpec
from iqtt.render import Rendered, render_question
from iqtt.shapes.splits import TooFewShapesError
from scenegen.common.errors import PlacementError, SpecError
from scenegen.files.content import content_digest
from scenegen.files.sets.making import complete_parts, parts_folder
from scenegen.rendering.backend import versions

ENDS = ("little", "big")
SECRET = 8_123_456_789_012_345
SPEC = SplitSpec(
    seed=SECRET, train=7, labeled=3, val=4, test=5, cubes=(6, 7), height=24, width=32,
    min_cube_pixels=1, lights=(1, 2),
)  # fmt: skip
SUITE_SPEC = replace(TINY, cubes=(9, 9), train=2, labeled=1, val=2, test=1)
COMMAND = f"iqtt make-split --seed {SECRET}"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "split"
    return folder, make_split(folder, SPEC, command=COMMAND)


@pytest.fixture
def folder(made):
    return made[0]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.h5")}


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


def test_the_same_request_gives_the_same_bytes(made, tmp_path, monkeypatch):
    """In other processes, in batches of another size; and they count the views they proposed."""
    monkeypatch.setattr(work, "BLOCK", 2)
    folder, expected = made
    tally = make_split(tmp_path / "again", SPEC, workers=2, batch=3, command=COMMAND)
    assert contents(tmp_path / "again") == contents(folder)
    assert os.listdir(tmp_path) == ["again"]
    assert tally == expected
    assert tally.proposed - tally.refused >= 4 * 16


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


@pytest.mark.parametrize(
    "changed",
    [
        {"height": 24, "width": 40, "min_angle_degrees": 90},
        {"height": 40, "width": 24, "lights": (1, 4)},
        {"max_radius": 10},
        {"cubes": (5, 6), "max_radius": 2.2, "distractors": "other"},
        {"seed": 2**63 - 1, "background": (0, 0, 0)},
        {"labeled": 0},
        {"train": 0, "labeled": 0, "val": 0, "test": 5},
    ],
)
def test_odd_requests_are_answered_in_full(changed, tmp_path):
    spec = replace(TINY, **changed)
    done = []
    make_split(tmp_path / "split", spec, batch=1, progress=done.append)
    assert sum(done) == spec.train + spec.val + spec.test
    for name, group, count in (
        ("train", "labeled/", spec.labeled), ("train", "unlabeled/", spec.train - spec.labeled),
        ("val", "", spec.val), ("test", "", spec.test),
    ):  # fmt: skip
        with h5py.File(tmp_path / "split" / f"iqtt-{name}.h5") as file:
            images = file[group + "questions"]
            assert images.shape == (count, 4, spec.height, spec.width, 3)
            raw = {image.tobytes() for image in images[:].reshape(-1, *images.shape[2:])}
            assert len(raw) == 4 * count, "all images differ"
            if f"{group}answers" in file:
                assert np.ptp(np.bincount(file[f"{group}answers"][:], minlength=3)) <= 1


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "plain"
    make_split(folder, TINY)
    return folder


@pytest.mark.parametrize(
    ("compression", "dtype"), [("none", "float16"), ("lzf", "float32"), ("gzip", "uint8")]
)
def test_plain_h5py_reads_every_type_and_compression(compression, dtype, plain, tmp_path):
    spec = replace(TINY, image_dtype=dtype, with_depth=True)
    make_split(tmp_path / "split", spec, compression=compression)
    for name, path in (("iqtt-train.h5", "unlabeled/questions"), ("iqtt-val.h5", "questions")):
        with h5py.File(plain / name) as whole, h5py.File(tmp_path / "split" / name) as file:
            images = file[path]
            assert images.dtype == dtype
            assert images.compression == (None if compression == "none" else compression)
            assert images.attrs["scale"] == (1 / 255 if dtype == "uint8" else 1)
            radiance = images[:] * images.attrs["scale"]
            assert radiance.min() >= 0
            assert radiance.max() == 1
            assert abs(radiance - whole[path][:] / 255).max() < 0.6 / 255
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


def test_other_files_of_a_folder_are_left_alone(tmp_path, monkeypatch):
    """Also where it is the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    make_split(".", TINY)
    make_split(".", TINY, overwrite=True)
    assert sorted(listing(tmp_path)) == sorted([*ALL_FILES, "notes.txt"])
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_errors_on_the_way_leave_nothing(tmp_path, monkeypatch):
    with pytest.raises(TooFewShapesError):
        make_split(tmp_path / "new", replace(TINY, cubes=(3, 3)))
    with pytest.raises(TooFewShapesError):
        make_split(tmp_path / "new", replace(SUITE_SPEC, cubes=(6, 6)), suite=True)
    monkeypatch.setattr("iqtt.questions.views.QUESTION_ATTEMPTS", 1)
    monkeypatch.setattr("iqtt.questions.views.VIEWS", 1)
    with pytest.raises(PlacementError):
        make_split(tmp_path / "new", replace(TINY, height=64, width=64, min_cube_pixels=14))
    assert list(tmp_path.iterdir()) == []


def test_the_suite_has_a_split_of_each_kind_in_a_folder_of_its_own(tmp_path):
    """One that was stopped goes on, with the same seed only."""
    rows: list[int] = []

    def stop(count):
        rows.append(count)
        if sum(rows) > 7:
            raise StopError

    home = tmp_path / "suite"
    with pytest.raises(StopError):
        make_split(home, SUITE_SPEC, progress=stop, compression="none", suite=True)
    parts = complete_parts(parts_folder(home / ALL_FILES[0]))
    first = {home / name: path.stat().st_mtime_ns for name, path in parts.items()}
    assert next(iter(SUITE)) in {path.parent.name for path in first}
    with pytest.raises(SpecError):
        make_split(home, replace(SUITE_SPEC, seed=9), compression="none", suite=True)
    tally = make_split(home, SUITE_SPEC, compression="none", suite=True)
    assert tally.proposed > 4 * 6 * 3
    assert {path: path.stat().st_mtime_ns for path in first} == first
    assert sorted(os.listdir(home)) == sorted(SUITE)
    for name, (kind, answers) in SUITE.items():
        with QuestionsFile(home / name / "iqtt-val.h5") as questions:
            expected = replace(SUITE_SPEC, seed=None, distractors=kind, answers=answers)
            assert questions.spec == expected
            kinds = questions.read("distractor_kind", slice(None))
            assert {question_kind(row) for row in kinds.tolist()} == {name}
            assert questions.read("questions", 0).shape == (1 + answers, 16, 16, 3)
            assert questions.compression() == "none"
    with pytest.raises(FileExistsError):
        make_split(home, SUITE_SPEC, compression="none", suite=True)


TABLES = [  # split, part, first question; the test split's truth lies in a file of its own
    ("train", "labeled", 0), ("train", "unlabeled", 3), ("val", "", 0), ("test", "", 0),
]  # fmt: skip
TRUTH = {
    "cube_count", "cubes", "shape_id", "class_id", "world_from_shape", "light_count",
    "light_position", "light_color", "distractor_kind", "angle_degrees", "visible_pixels",
    "camera_distance",
}  # fmt: skip


def everything(file):
    found = {"/": file["/"]}
    file.visititems(found.__setitem__)
    return found


def test_the_layout_is_the_released_one(folder):
    assert sorted(path.name for path in folder.glob("*.h5")) == sorted(FILES)
    images = (4, 24, 32, 3)
    labeled = {"labeled/questions": (3, *images), "labeled/answers": (3,)}
    for name, public, parts in (
        (
            "train",
            labeled | {"unlabeled/questions": (4, *images)},
            {"labeled/": 3, "unlabeled/": 4},
        ),
        ("val", {"questions": (4, *images), "answers": (4,)}, {"": 4}),
        ("test", {"questions": (5, *images)}, {}),
        ("test-answers", {"answers": (5,)}, {"": 5}),
    ):
        with h5py.File(folder / f"iqtt-{name}.h5") as file:
            found = {k: v for k, v in everything(file).items() if isinstance(v, h5py.Dataset)}
            truth = {k: len(found.pop(k)) for k in list(found) if k.startswith("truth/")}
            assert {k: v.shape for k, v in found.items()} == public
            assert {v.dtype for v in found.values()} == {np.dtype("uint8")}
            assert truth == {f"truth/{p}{one}": rows for p, rows in parts.items() for one in TRUTH}


@pytest.mark.parametrize(("split", "part", "first"), TABLES)
def test_tables_hold_the_questions_that_are_made_one_by_one(folder, split, part, first):
    pools, group = make_pools(SPEC), part or "/"
    beside = folder / f"iqtt-{split}{'-answers' if split == 'test' else ''}.h5"
    with h5py.File(folder / f"iqtt-{split}.h5") as file, h5py.File(beside) as known:
        questions, truth = file[group]["questions"], known[f"truth/{part}"]
        answers = None if part == "unlabeled" else known[group]["answers"]
        for row in range(len(questions)):
            one: Rendered = render_question(pools, split, first + row)
            assert questions[row].tobytes() == one.images.tobytes()
            shapes, count = one.question.shapes.cubes, one.question.shapes.cubes.shape[1]
            stored = {name: truth[name][row] for name in TRUTH}
            assert stored["cube_count"] == count
            assert np.array_equal(stored["cubes"][:, :count], shapes)
            assert (stored["cubes"][:, count:] == -128).all()
            assert np.array_equal(stored["distractor_kind"], one.question.shapes.kinds)
            assert np.array_equal(stored["visible_pixels"], one.visible_pixels)
            for name in ("world_from_shape", "light_count", "light_position", "light_color"):
                assert np.array_equal(stored[name], getattr(one.question, name)), name
            assert stored["angle_degrees"] == one.question.angle_degrees
            assert stored["camera_distance"] == one.question.camera_distance
            for i, j in ((i, j) for i in range(4) for j in range(i)):
                same = are_congruent(shapes[i], shapes[j])
                alike = same or are_congruent(shapes[i], -shapes[j])
                assert (stored["shape_id"][i] == stored["shape_id"][j]).all() == same
                assert (stored["class_id"][i] == stored["class_id"][j]).all() == alike
            answer = stored["distractor_kind"].tolist().index(-1)
            assert answer == one.question.shapes.answer
            assert answers is None or answers[row] == answer
        if answers is not None:
            assert sorted(answers[:].tolist()) == sorted(i % 3 for i in range(len(answers)))


def plain_digest(dataset):
    """As the documents tell anyone to make it."""
    rows = (hashlib.sha256(row.tobytes()).digest() for row in dataset[:])
    return hashlib.sha256(b"".join(rows)).hexdigest()


@pytest.mark.parametrize("name", FILES)
def test_digests_are_of_what_was_written(folder, name):
    with h5py.File(folder / name) as file:
        digests = {}
        for place, item in everything(file).items():
            if isinstance(item, h5py.Dataset):
                digests[place] = item.attrs["sha256"]
                assert digests[place] == plain_digest(item), place
        assert file.attrs["content_digest"] == content_digest(file)
        told = {key for key in file.attrs if key.startswith("truth_digest")}
        part = {"iqtt-train.h5": "labeled", "iqtt-test.h5": None}.get(name, "")
        assert told == (set() if part is None else {f"truth_digest_{part}".rstrip("_")})
        for key in told:
            names = ("angle_degrees", "answers", "distractor_kind")
            paths = [f"{part}/{n}" if n == "answers" else f"truth/{part}/{n}" for n in names]
            places = [path.replace("//", "/").strip("/") for path in paths]
            lines = "".join(f"{n} {digests[p]}\n" for n, p in zip(names, places, strict=True))
            assert file.attrs[key] == hashlib.sha256(lines.encode()).hexdigest()


def test_fingerprints_are_of_the_public_settings_and_of_all_that_tables_tell(folder):
    """So they tell tables apart, join a test set to its answers, and tell no seed."""
    found = set()
    for split, part, _ in TABLES:
        beside = folder / f"iqtt-{split}{'-answers' if split == 'test' else ''}.h5"
        with h5py.File(folder / f"iqtt-{split}.h5") as file, h5py.File(beside) as known:
            truth = known[f"truth/{part}"]
            request = hashlib.sha256(f"{SPEC.public().to_json()} {split} {part}".encode())
            names = ("cubes", "distractor_kind", "light_color", "light_position")
            lines = [f"{name} {truth[name].attrs['sha256']}" for name in names]
            lines += [f"request {request.hexdigest()}"]
            lines += [f"world_from_shape {truth['world_from_shape'].attrs['sha256']}", ""]
            digest = hashlib.sha256("\n".join(lines).encode())
            name = f"fingerprint_{part}" if part else "fingerprint"
            assert file.attrs[name] == known.attrs[name] == digest.hexdigest()
            found.add(digest.hexdigest())
    assert len(found) == 4

"""The files of a split: the released layout and our group, told in full and truly."""

import hashlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from polycubes import are_congruent

from iqtt.files.make import make_split
from iqtt.files.split import ALL_FILES as FILES
from iqtt.questions.distractors import make_pools
from iqtt.questions.specs import SplitSpec
from iqtt.render import Rendered, render_question
from scenegen.files.content import content_digest

SPEC = SplitSpec(
    seed=3, train=7, labeled=3, val=4, test=5, cubes=(6, 7), height=24, width=32,
    min_cube_pixels=1, lights=(1, 2),
)  # fmt: skip
TABLES = [  # split, part, first question; the test split's truth lies in a file of its own
    ("train", "labeled", 0), ("train", "unlabeled", 3), ("val", "", 0), ("test", "", 0),
]  # fmt: skip
TRUTH = {
    "cube_count", "cubes", "shape_id", "class_id", "world_from_shape", "light_count",
    "light_position", "light_color", "distractor_kind", "angle_degrees", "visible_pixels",
    "camera_distance",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "split"
    make_split(folder, SPEC)
    return folder


def everything(file: h5py.File) -> dict[str, h5py.Group | h5py.Dataset]:
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

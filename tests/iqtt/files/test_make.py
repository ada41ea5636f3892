"""The files of a split: the released layout, our own group, and nothing that tells test answers."""

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from polycubes import are_congruent

from iqtt.files.layout import CONVENTIONS
from iqtt.files.make import FILES, make_split
from iqtt.questions.distractors import Pools, make_pools
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import Tally
from iqtt.render import Rendered, render_question
from scenegen.rendering.backend import versions

SECRET = 8_123_456_789_012_345
SPEC = SplitSpec(
    seed=SECRET, train=7, labeled=3, val=4, test=5, cubes=(6, 7), height=24, width=32,
    min_cube_pixels=1, lights=(1, 2),
)  # fmt: skip
COMMAND = f"iqtt make-split --seed {SECRET}"
TRUTH = {
    "cube_count", "cubes", "shape_id", "class_id", "world_from_shape", "light_count",
    "light_position", "light_color", "distractor_kind", "angle_degrees", "visible_pixels",
}  # fmt: skip
AGAIN = """
import sys
from iqtt.questions.specs import SplitSpec
from iqtt.files.make import make_split
make_split(sys.argv[1], SplitSpec.from_json(sys.argv[2]), batch=3, command=sys.argv[3])
"""


@pytest.fixture(scope="module")
def pools() -> Pools:
    return make_pools(SPEC)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "split"
    tally = make_split(folder, SPEC, command=COMMAND)
    assert isinstance(tally, Tally)
    assert tally.proposed - tally.refused >= 4 * 16
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def everything(file: h5py.File) -> dict[str, h5py.Group | h5py.Dataset]:
    found = {"/": file["/"]}
    file.visititems(found.__setitem__)
    return found


def test_the_layout_is_the_released_one(folder):
    assert sorted(contents(folder)) == sorted(FILES)
    expected = {
        "iqtt-train.h5": {
            "labeled/questions": (3, 4, 24, 32, 3),
            "labeled/answers": (3,),
            "unlabeled/questions": (4, 4, 24, 32, 3),
        },
        "iqtt-val.h5": {"questions": (4, 4, 24, 32, 3), "answers": (4,)},
        "iqtt-test.h5": {"questions": (5, 4, 24, 32, 3)},
        "iqtt-test-answers.h5": {"answers": (5,)},
    }
    for name, shapes in expected.items():
        with h5py.File(folder / name) as file:
            datasets = {k: v for k, v in everything(file).items() if isinstance(v, h5py.Dataset)}
            public = {k: v.shape for k, v in datasets.items() if not k.startswith("truth/")}
            assert public == shapes
            assert {datasets[k].dtype for k in public} == {np.dtype("uint8")}
            for group in {"iqtt-train.h5": ("labeled", "unlabeled")}.get(name, ("",)):
                rows = next(iter(v[0] for k, v in shapes.items() if k.startswith(group)))
                known = {k for k in datasets if k.startswith(f"truth/{group}")}
                if name == "iqtt-test.h5":
                    assert not known
                    continue
                prefix = f"truth/{group}/" if group else "truth/"
                assert known == {prefix + one for one in TRUTH}
                assert {len(datasets[k]) for k in known} == {rows}


def test_files_hold_the_questions_that_are_made_one_by_one(folder, pools):
    with (
        h5py.File(folder / "iqtt-train.h5") as train,
        h5py.File(folder / "iqtt-val.h5") as val,
        h5py.File(folder / "iqtt-test.h5") as test,
        h5py.File(folder / "iqtt-test-answers.h5") as told,
    ):
        tables = [
            (
                "train",
                0,
                train["labeled/questions"],
                train["truth/labeled"],
                train["labeled/answers"],
            ),
            ("train", 3, train["unlabeled/questions"], train["truth/unlabeled"], None),
            ("val", 0, val["questions"], val["truth"], val["answers"]),
            ("test", 0, test["questions"], told["truth"], told["answers"]),
        ]
        for split, first, questions, truth, answers in tables:
            for row in range(len(questions)):
                one: Rendered = render_question(SPEC, pools, split, first + row)
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
                for i, j in ((i, j) for i in range(4) for j in range(i)):
                    same = are_congruent(shapes[i], shapes[j])
                    mirrored = are_congruent(shapes[i], -shapes[j])
                    assert (stored["shape_id"][i] == stored["shape_id"][j]).all() == same
                    assert (stored["class_id"][i] == stored["class_id"][j]).all() == (
                        same or mirrored
                    )
                answer = int(np.flatnonzero(truth["distractor_kind"][row] == -1)[0])
                assert answer == one.question.shapes.answer
                if answers is not None:
                    assert answers[row] == answer
            if answers is not None:
                assert sorted(answers[:].tolist()) == sorted(i % 3 for i in range(len(answers)))


def test_every_number_says_what_it_is(folder):
    for name in FILES:
        with h5py.File(folder / name) as file:
            for path, item in everything(file).items():
                if isinstance(item, h5py.Dataset):
                    assert item.attrs["meaning"], path
                    assert path.endswith("answers") or item.attrs["unit"], path
            for path in ("truth", "truth/labeled", "truth/unlabeled"):
                if "questions" not in file.get(path, {}) and "cubes" in file.get(path, {}):
                    attributes = file[path].attrs
                    np.testing.assert_array_equal(
                        attributes["world_from_camera"], SPEC.camera.world_from_camera
                    )
                    assert attributes["fov_y_degrees"] == SPEC.camera.fov_y_degrees
                    for one in ("ambient", "reflectance", "background"):
                        assert tuple(attributes[one]) == getattr(SPEC, one)
                    assert attributes["attenuation"].tolist() == [0, 1]
            root = file.attrs
            assert root["format"] == "pix2shape-bench/iqtt"
            assert root["conventions"] == CONVENTIONS
            assert root["split"] == name.split("-")[1].removesuffix(".h5")
            spec = SplitSpec.from_json(root["spec"])
            assert spec == (SPEC if "answers" in name else SPEC.public())
            if "questions" in file:
                assert file["questions"].attrs["scale"] == 1 / 255


def test_nothing_handed_out_tells_the_test_answers(folder):
    """No seed, no command, no truth; and no bytes that follow from the answers but a hash of much
    more than them.
    """
    with h5py.File(folder / "iqtt-test.h5") as file:
        assert set(everything(file)) == {"/", "questions"}
        assert set(file.attrs) == {
            "format", "format_version", "writer", "variant", "spec", "conventions", "split",
            "fingerprint", *versions(),
        }  # fmt: skip
        assert {name: file.attrs[name] for name in versions()} == versions()
        assert set(file["questions"].attrs) == {"unit", "shape", "frame", "meaning", "scale"}
        assert re.fullmatch("[0-9a-f]{64}", file.attrs["fingerprint"])
    with h5py.File(folder / "iqtt-test-answers.h5") as file:
        assert file.attrs["creation_command"] == COMMAND
    for name, raw in contents(folder).items():
        secret = "answers" in name
        assert (str(SECRET).encode() in raw) == secret
        assert (SECRET.to_bytes(8, "little") in raw) is False
        assert (b"creation_command" in raw) == secret


def test_the_same_request_gives_the_same_bytes(folder, tmp_path):
    """In another process, in batches of another size."""
    command = [sys.executable, "-c", AGAIN, str(tmp_path / "again"), SPEC.to_json(), COMMAND]
    subprocess.run(command, check=True, capture_output=True)
    assert contents(tmp_path / "again") == contents(folder)
    assert os.listdir(tmp_path) == ["again"]


def test_another_seed_changes_every_file(folder, tmp_path):
    make_split(tmp_path / "other", replace(SPEC, seed=SECRET + 1), command=COMMAND)
    old, new = contents(folder), contents(tmp_path / "other")
    assert all(old[name] != new[name] for name in FILES)
    for name in FILES[:3]:
        with h5py.File(folder / name) as a, h5py.File(tmp_path / "other" / name) as b:
            assert a.attrs["spec"] == b.attrs["spec"]
            for path in ("questions", "labeled/questions", "unlabeled/questions"):
                if path in a:
                    assert (a[path][:] != b[path][:]).any(axis=(1, 2, 3, 4)).all()


def test_a_table_does_not_depend_on_the_size_of_the_others(folder, tmp_path):
    """Fingerprints, which hold the whole request, apart."""
    changed = replace(SPEC, val=1, test=0, labeled=3, train=3)
    make_split(tmp_path / "changed", changed)
    with (
        h5py.File(folder / "iqtt-train.h5") as a,
        h5py.File(tmp_path / "changed" / "iqtt-train.h5") as b,
    ):
        for path, item in everything(a).items():
            if isinstance(item, h5py.Dataset) and "unlabeled" not in path:
                assert item[:].tobytes() == b[path][:].tobytes()
        assert b["unlabeled/questions"].shape == (0, 4, 24, 32, 3)
        assert a.attrs["fingerprint_labeled"] != b.attrs["fingerprint_labeled"]


def test_fingerprints_are_of_the_public_request_and_of_all_that_tables_say(folder):
    """So they tell tables apart, join a test set to its answers, and tell no seed."""
    found = []
    for name in FILES:
        split = name.split("-")[1].removesuffix(".h5")
        with h5py.File(folder / name) as file:
            for group in ("labeled", "unlabeled") if split == "train" else ("",):
                told = file.attrs[f"fingerprint_{group}" if group else "fingerprint"]
                if f"truth/{group}" not in file:
                    assert told == found_in_answers(folder)
                    continue
                truth = {k: v[:] for k, v in file[f"truth/{group}"].items()}
                digest = hashlib.sha256(f"{SPEC.public().to_json()} {split} {group}".encode())
                for row, kinds in enumerate(truth["distractor_kind"]):
                    for one in ("cubes", "world_from_shape", "light_position", "light_color"):
                        digest.update(truth[one][row].tobytes())
                    digest.update(bytes([kinds.tolist().index(-1)]))
                assert told == digest.hexdigest()
                found.append(told)
    assert len(set(found)) == 4


def found_in_answers(folder: Path) -> str:
    with h5py.File(folder / "iqtt-test-answers.h5") as file:
        return file.attrs["fingerprint"]

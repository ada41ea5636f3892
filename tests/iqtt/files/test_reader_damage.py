"""Question files with datasets of the wrong shape, type or value: one line says which."""

import h5py
import numpy as np
import pytest

from iqtt.files.reader import open_questions
from scenegen.common.errors import FileFormatError


@pytest.fixture
def refuse(check_line):
    def call(path, *words):
        with pytest.raises(FileFormatError) as error:
            open_questions(path)
        check_line(error, path, *words)

    return call


def put(name, values):
    """Put something else where a dataset was."""

    def edit(file):
        del file[name]
        if values is not None:
            file[name] = values

    return edit


def grouped(name):
    return lambda file: (file.pop(name), file.create_group(name))


def attribute(name, value):
    return lambda file: file.attrs.pop(name) if value is None else file.attrs.update({name: value})


IMAGES, ONE = np.zeros((6, 4, 32, 32, 3), np.uint8), np.zeros(6, np.uint8)
OURS = {
    "other format": (attribute("format", "other"), "'other'"),
    "format is an array": (attribute("format", np.arange(3)), "pix2shape-bench/iqtt"),
    "newer": (attribute("format_version", "2.1"), "format version 2.1"),
    "no version": (attribute("format_version", None), "format version None"),
    "no writer": (attribute("writer", None), "'writer' is missing"),
    "no spec": (attribute("spec", None), "'spec' is missing"),
    "spec is garbage": (attribute("spec", "garbage"), "'spec': split spec"),
    "spec is a list": (attribute("spec", "[]"), "'spec': split spec: found"),
    "spec of the future": (attribute("spec", '{"fog": 1}'), "'spec'", "fog"),
    "spec of another size": (attribute("spec", "{}"), "questions: shape", "(Q, 4, 128, 128, 3)"),
    "no split": (attribute("split", None), "'split': found None, expected one of train"),
    "unknown split": (attribute("split", "dev"), "'split': found 'dev'"),
    "no fingerprint": (attribute("fingerprint", None), "'fingerprint': found None"),
    "fingerprint is an array": (attribute("fingerprint", np.arange(9)), "'fingerprint'"),
    "questions gone": (put("questions", None), "no images"),
    "questions is a group": (grouped("questions"), "questions: a group, expected a dataset"),
    "three images": (put("questions", IMAGES[:, :3]), "(6, 3, 32, 32, 3), expected (Q, 4, 32"),
    "questions of floats": (put("questions", IMAGES.astype("f4")), "type float32, expected uint8"),
    "fewer answers": (put("answers", ONE[:5]), "answers: shape (5,), type uint8, expected (6,)"),
    "answers of floats": (put("answers", ONE.astype("f4")), "type float32", "whole numbers"),
    "answers of texts": (put("answers", ["0"] * 6), "answers", "whole numbers"),
    "answers nowhere": (put("answers", h5py.Empty("u1")), "answers: shape ()"),
    "answer 3": (put("answers", ONE + 3), "answers, row 0: 3, expected 0, 1 or 2"),
    "answer -1": (put("answers", np.array([0, 1, -1, 2, 0, 0])), "row 2: -1, expected"),
    "truth is a dataset": (put("truth", 7), "truth", "expected a group"),
    "no cubes": (put("truth/cubes", None), "truth: dataset 'cubes' is missing"),
    "cubes too few": (
        put("truth/cubes", np.zeros((6, 4, 3, 3), "i1")),
        "cubes: shape (6, 4, 3, 3)",
    ),
    "cubes of floats": (put("truth/cubes", np.zeros((6, 4, 7, 3))), "cubes: type float64"),
    "no names": (lambda f: f["truth/distractor_kind"].attrs.pop("names"), "names"),
}


@pytest.mark.parametrize("name", OURS)
def test_damaged_layouts(refuse, damaged, name):
    edit, *words = OURS[name]
    refuse(damaged(edit), *words)


def wrong_value(name, row, value):
    return lambda file: file[f"truth/{name}"].__setitem__(row, value)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("cube_count", 8, "cube_count: found 8, expected 1 to 7"),
        ("cube_count", 0, "cube_count: found 0, expected 1 to 7"),
        ("light_count", 3, "light_count: found [3, 3, 3, 3], expected 0 to 2"),
        ("light_count", -1, "expected 0 to 2"),
        ("distractor_kind", 3, "distractor_kind: found [3, 3, 3], expected -1 to 2"),
        ("distractor_kind", -2, "expected -1 to 2"),
    ],
)
def test_damaged_truth_of_one_row(check_line, damaged, name, value, words):
    path = damaged(wrong_value(name, 4, value))
    with open_questions(path) as questions:
        assert questions[3].truth is not None
        with pytest.raises(FileFormatError) as error:
            questions[4]
        check_line(error, path, "row 4: ", words)


def test_a_damaged_chunk_spoils_its_row_only(check_line, damaged):
    def scribble(file):
        file["questions"].id.write_direct_chunk((2, 0, 0, 0, 0), b"\x00" * 40)

    path = damaged(scribble)
    with open_questions(path) as questions:
        assert questions[1].images.shape == questions[3].images.shape
        for rows, where in ((2, "questions, row 2"), (slice(1, None), "questions, rows 1 to 5")):
            with pytest.raises(FileFormatError) as error:
                questions.read("questions", rows)
            check_line(error, path, where, "cannot be read")


@pytest.mark.parametrize(
    ("questions", "words"),
    [
        (np.zeros((5, 4, 8, 8)), "questions: shape (5, 4, 8, 8), expected (Q, 4, H, W, 3)"),
        (np.zeros((5, 3, 8, 8, 3)), "shape (5, 3, 8, 8, 3), expected (Q, 4, H, W, 3)"),
        (np.zeros((5, 4, 3, 8, 8)), "shape (5, 4, 3, 8, 8), expected (Q, 4, H, W, 3)"),
        (np.zeros((5, 4, 0, 8, 3)), "shape (5, 4, 0, 8, 3)"),
        (np.float32(3), "shape ()"),
        (h5py.Empty("f4"), "shape ()"),
        (np.zeros((5, 4, 8, 8, 3), np.int16), "type int16, expected uint8 or float16 or float32"),
        (np.zeros((5, 4, 8, 8, 3)), "type float64"),
        (np.full((5, 4, 8, 8, 3), 255, np.float32), "row 0: values from 255 to 255, expected 0 to"),
        (np.full((5, 4, 8, 8, 3), np.nan, np.float32), "values from nan to nan"),
        (np.full((5, 4, 8, 8, 3), -0.5, np.float32), "values from -0.5 to -0.5"),
    ],
)
def test_released_files_of_other_shapes(refuse, released, questions, words):
    path = released()
    with h5py.File(path, "r+") as file:
        put("questions", questions)(file)
    refuse(path, words)


def test_claims_beyond_the_memory(refuse, tmp_path):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("questions", (10**13, 4, 16, 16, 3), "u1", chunks=(1, 4, 16, 16, 3))
        file.create_dataset("answers", (10**13,), "i8", chunks=(1024,))
    refuse(path, "damaged")

"""Everything that can be wrong with a question file, and what the reader, info and verify say."""

import os
import shutil

import h5py
import numpy as np
import pytest
from h5_edits import attribute, claims, damaged_chunk, gone, grouped, linked
from root_edits import ROOT

from iqtt.files.reader import (
    AnswersFile,
    NoAnswersError,
    NoImagesError,
    open_questions,
    open_tables,
    parts,
)
from iqtt.files.verify import verify_split
from iqtt.questions.kinds import DISTRACTOR_KINDS
from scenegen.common.errors import FileFormatError, SpecError


def refused(path, place, read=open_questions):
    """Check that a file is refused in one line that says where it is wrong; return the error."""
    with pytest.raises(FileFormatError) as error:
        read(path)
    assert error.value.where.startswith(f"{path}: {place}" if place else str(path))
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400
    return error.value


def put(name, values):
    def edit(file):
        del file[name]
        file[name] = values

    return edit


def named(names):
    return lambda file: file["truth/distractor_kind"].attrs.update(names=names)


IMAGES, ONE = np.zeros((6, 4, 32, 32, 3), np.uint8), np.zeros(6, np.uint8)
NAMES = "truth: distractor_kind: attribute 'names'"
# Edits of a good validation file, and the place that the error names.
REFUSED = {
    **ROOT,
    "spec of another size": (attribute("spec", "{}"), "questions"),
    "no split": (gone("split"), "attribute 'split'"),
    "unknown split": (attribute("split", "dev"), "attribute 'split'"),
    "questions is a group": (grouped("questions"), "questions"),
    "another scale": (lambda f: f["questions"].attrs.update(scale=1.0), "questions"),
    "three images": (put("questions", IMAGES[:, :3]), "questions"),
    "questions of floats": (put("questions", IMAGES.astype("f4")), "questions"),
    "fewer answers": (put("answers", ONE[:5]), "answers"),
    "answers of floats": (put("answers", ONE.astype("f4")), "answers"),
    "answers of texts": (put("answers", ["0"] * 6), "answers"),
    "answers nowhere": (put("answers", h5py.Empty("u1")), "answers"),
    "answer 3": (put("answers", ONE + 3), "answers, row 0"),
    "answer -1": (put("answers", np.array([0, 1, -1, 2, 0, 0])), "answers, row 2"),
    "truth is a dataset": (put("truth", 7), "truth"),
    "no cubes": (gone("truth/cubes"), "truth"),
    "cubes too few": (put("truth/cubes", np.zeros((6, 4, 3, 3), "i1")), "truth"),
    "cubes of floats": (put("truth/cubes", np.zeros((6, 4, 7, 3))), "truth"),
    "a dead link": (linked("answers", h5py.SoftLink("/nothing")), "answers"),
    "no names": (lambda f: f["truth/distractor_kind"].attrs.pop("names"), NAMES),
    "names are numbers": (named([0, 1, 2]), NAMES),
    "one name": (named("near"), NAMES),
    "many names": (named(["near"] * 101), NAMES),
    "names in another order": (named(["near", "other", "mirror", "matched"]), NAMES),
    "names that cannot be printed": (named(["near", "\x1b[2J", "other"]), NAMES),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_question_file_is_refused(damaged, kind):
    edit, place = REFUSED[kind]
    refused(damaged(edit), place)


def test_files_of_format_1_0_are_read(damaged):
    """They did not name `near-mirror`. Whatever names the list began with can be read."""

    def older(file):
        file.attrs["format_version"] = "1.0"
        named(["other", "near", "mirror", "matched"])(file)
        kinds = file["truth/distractor_kind"][:]
        file["truth/distractor_kind"][:] = np.where(kinds == 4, 2, kinds)

    with open_questions(damaged(older)) as questions:
        assert "near-mirror" not in {
            k for i in range(6) for k in questions[i].truth.distractor_kind
        }
    for names in ([], ["near", "other"], [*DISTRACTOR_KINDS, "later"], [["other"]]):
        refused(damaged(named(names)), NAMES)
    with open_questions(damaged(named(["other"]))) as questions, pytest.raises(FileFormatError):
        [questions[i].truth for i in range(6)]


# A value of row 4, and the range that the error names.
OUT_OF_RANGE = [
    ("cube_count", 8, "1 to 7"),
    ("cube_count", 0, "1 to 7"),
    ("light_count", 3, "0 to 2"),
    ("light_count", -1, "0 to 2"),
    ("distractor_kind", 5, "-1 to 4"),
    ("distractor_kind", -2, "-1 to 4"),
    ("angle_degrees", np.nan, "0 to 180"),
    ("angle_degrees", 181, "0 to 180"),
    *(("camera_distance", x, "0.001 to 1000000000.0") for x in (0, -1, np.nan, np.inf, 1e300)),
]


@pytest.mark.parametrize(("name", "value", "expected"), OUT_OF_RANGE)
def test_a_value_out_of_its_range_spoils_its_row_only(damaged, name, value, expected):
    path = damaged(lambda file: file[f"truth/{name}"].__setitem__(4, value))
    with open_questions(path) as questions:
        assert questions[3].truth is not None
        for read in (lambda: questions[4], lambda: questions.read(name, slice(1, None))):
            with pytest.raises(FileFormatError) as error:
                read()
            assert error.value.where == f"{path}: {name}, row 4"
            assert error.value.expected == expected


def test_a_damaged_chunk_spoils_its_row_only(damaged):
    path = damaged(damaged_chunk("questions", 2))
    with open_questions(path) as questions:
        assert questions[1].images.shape == questions[3].images.shape
        for rows, where in ((2, "questions, row 2"), (slice(1, None), "questions, rows 1 to 5")):
            refused(path, where, read=lambda _, rows=rows: questions.read("questions", rows))


@pytest.mark.parametrize("read", [open_questions, parts, open_tables, AnswersFile])
def test_what_is_no_file(tmp_path, split_folder, rooms_path, read):
    os.mkfifo(tmp_path / "pipe.h5")  # which must not be waited for
    for name, kind in (
        ("none.h5", FileNotFoundError),
        ("", IsADirectoryError),
        ("pipe.h5", OSError),
    ):
        with pytest.raises(kind) as error:
            read(tmp_path / name)
        assert error.value.filename == str(tmp_path / name)
    data, path = (split_folder / "iqtt-val.h5").read_bytes(), tmp_path / "x.h5"
    cut = [data[: int(len(data) * part)] for part in (0.001, 0.3, 0.9, 0.999)]
    for content in (b"", b"hello\n" * 50, b"\x89HDF\r\n\x1a\n" + bytes(500), *cut):
        path.write_bytes(content)
        assert "errno" not in str(refused(path, "", read=read))
    refused(rooms_path, "", read=read)
    h5py.File(path, "w").close()
    refused(path, "", read=read)


def test_answers_alone_and_questions_alone(split_folder, tmp_path, damaged):
    assert isinstance(refused(damaged(gone("questions")), ""), NoImagesError)
    path = split_folder / "iqtt-test-answers.h5"
    assert "iqtt-test.h5" in refused(path, "").hint
    with pytest.raises(NoImagesError):
        parts(path)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["answers"] = [0, 1]
    assert isinstance(refused(tmp_path / "a.h5", ""), NoImagesError)
    asked = split_folder / "iqtt-test.h5"
    assert isinstance(refused(asked, "", read=AnswersFile), NoAnswersError)


FLOATS = np.zeros((5, 4, 8, 8, 3), np.float32)
IMAGES_OF_OTHERS = (
    FLOATS[..., 0], FLOATS[:, :3], FLOATS[:, :, :0], np.float32(3), h5py.Empty("f4"),
    FLOATS.astype(np.int16), FLOATS.astype(np.float64), FLOATS + 255, FLOATS * np.nan, FLOATS - 0.5,
)  # fmt: skip


@pytest.mark.parametrize("questions", IMAGES_OF_OTHERS)
def test_released_files_with_other_images(released, questions):
    path = released()
    with h5py.File(path, "r+") as file:
        put("questions", questions)(file)
    refused(path, "questions")


def test_claims_beyond_the_memory(damaged):
    def edit(file):
        file.attrs.clear()
        claims("questions", (10**13, 4, 16, 16, 3), "u1", chunks=(1, 4, 16, 16, 3))(file)
        claims("answers", (10**13,), "i8", chunks=(1024,))(file)

    refused(damaged(edit), "")


def test_answers_of_other_questions(split_folder, damaged, released):
    path, answers = split_folder / "iqtt-test.h5", split_folder / "iqtt-test-answers.h5"
    with pytest.raises(SpecError) as error:
        open_questions(split_folder / "iqtt-val.h5", answers=answers)
    assert error.value.where == "answers"
    forged = damaged(attribute("fingerprint", "0123456789abcdef"), answers.name)
    fewer = released("few.h5", {"": (5, None)})
    with h5py.File(fewer.with_name("a.h5"), "w") as file:
        file["answers"] = [0, 1, 2, 0]
    for asked, told in ((path, forged), (fewer, fewer.with_name("a.h5")), (fewer, answers)):
        with pytest.raises(FileFormatError) as mixed_up:
            open_questions(asked, answers=told)
        assert mixed_up.value.where == f"{told}: answers"
        assert str(asked) in mixed_up.value.expected
    with pytest.raises(FileNotFoundError):
        open_questions(path, answers=fewer.with_name("none.h5"))


def test_questions_are_made_again(split_folder, tmp_path):
    assert all(check.ok for check in verify_split(split_folder, items=2))
    shutil.copytree(split_folder, tmp_path / "x")
    with h5py.File(tmp_path / "x" / "iqtt-val.h5", "r+") as file:
        file["questions"][0, 1] = file["questions"][0, 2]
    failed = {check.name for check in verify_split(tmp_path / "x", items=2) if not check.ok}
    assert "made again from the seed" in failed

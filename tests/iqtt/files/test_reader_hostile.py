"""Files that are no question files, or not any more: one clear line, and nothing kept open."""

import os
import shutil

import h5py
import numpy as np
import pytest

from iqtt.files.reader import AnswersFile, QuestionsFile, open_questions, parts
from iqtt.files.tables import NoImagesError
from scenegen.common.errors import FileFormatError, SpecError


@pytest.fixture
def refuse(check_line):
    def call(path, *words):
        with pytest.raises(FileFormatError) as error:
            open_questions(path)
        return check_line(error, path, *words)

    return call


@pytest.mark.parametrize("read", [open_questions, parts, AnswersFile])
def test_no_such_file_or_a_folder(tmp_path, read):
    with pytest.raises(FileNotFoundError, match="no such file") as error:
        read(tmp_path / "none.h5")
    assert error.value.filename == str(tmp_path / "none.h5")
    with pytest.raises(IsADirectoryError, match="is a folder; name a question file"):
        read(tmp_path)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.h5")
    with pytest.raises(OSError, match="not a regular file"):
        open_questions(tmp_path / "pipe.h5")


@pytest.mark.parametrize("content", [b"", b"hello\n" * 50, b"\x89HDF\r\n\x1a\n" + bytes(500)])
def test_no_hdf5(refuse, tmp_path, content):
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    assert "errno" not in refuse(path, "not a readable HDF5 file")


@pytest.mark.parametrize("part", [0.001, 0.3, 0.9, 0.999])
def test_truncated(refuse, split_folder, tmp_path, part):
    data = (split_folder / "iqtt-val.h5").read_bytes()
    path = tmp_path / "x.h5"
    path.write_bytes(data[: int(len(data) * part)])
    refuse(path, "HDF5")
    path.write_bytes(data)
    with open_questions(path) as questions:
        assert len(questions) == 6


def test_a_rooms_file(check_line, tmp_path):
    with h5py.File(tmp_path / "rooms.h5", "w") as file:
        file.attrs["format"] = "pix2shape-bench/rooms"
        file["image"] = np.zeros((2, 8, 8, 3), np.uint8)
    for read in (open_questions, parts):
        with pytest.raises(FileFormatError) as error:
            read(tmp_path / "rooms.h5")
        check_line(error, tmp_path / "rooms.h5", "'pix2shape-bench/rooms'", "pix2shape-bench/iqtt")


def test_nothing_to_ask(refuse, tmp_path):
    h5py.File(tmp_path / "x.h5", "w").close()
    refuse(tmp_path / "x.h5", "not a question file", "'questions'", "'labeled/questions'")


def test_answers_alone(refuse, split_folder, tmp_path):
    path = split_folder / "iqtt-test-answers.h5"
    refuse(path, "no images", "open iqtt-test.h5 instead", "this file for answers")
    with pytest.raises(NoImagesError):
        parts(path)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["answers"] = [0, 1]
    refuse(tmp_path / "a.h5", "no images", "open the file of questions instead")
    with pytest.raises(FileFormatError, match="questions but no answers"):
        AnswersFile(split_folder / "iqtt-test.h5")


def test_parts_that_are_not_there(split_folder):
    train, val = split_folder / "iqtt-train.h5", split_folder / "iqtt-val.h5"
    for path, part, words in (
        (train, None, "found none, expected labeled or unlabeled"),
        (train, "", "found none, expected labeled or unlabeled"),
        (train, "validation", "found validation, expected labeled or unlabeled"),
        (val, "labeled", "found labeled, expected none"),
    ):
        with pytest.raises(SpecError, match=words) as error:
            open_questions(path, part)
        assert str(path) in str(error.value)


def test_answers_of_other_questions(check_line, split_folder, damaged, released):
    path, answers = split_folder / "iqtt-test.h5", split_folder / "iqtt-test-answers.h5"
    with pytest.raises(SpecError, match="has its own"):
        open_questions(split_folder / "iqtt-val.h5", answers=answers)

    def other(file):
        file.attrs["fingerprint"] = "0123456789abcdef"

    forged = damaged(other, answers.name)
    with pytest.raises(FileFormatError) as error, QuestionsFile(path) as told:
        open_questions(path, answers=forged)
    check_line(error, forged, "found 6 questions, fingerprint 0123456789ab,", told.fingerprint[:12])
    fewer = released("few.h5", {"": (5, None)})
    with h5py.File(fewer.with_name("a.h5"), "w") as file:
        file["answers"] = [0, 1, 2, 0]
    for beside in (fewer.with_name("a.h5"), answers):
        with pytest.raises(FileFormatError, match=r"expected 5 questions, no fingerprint"):
            open_questions(fewer, answers=beside)
    with pytest.raises(FileNotFoundError, match=r"no such file"):
        open_questions(path, answers=fewer.with_name("none.h5"))


def test_files_are_closed(split_folder, tmp_path):
    """HDF5 opens no file for writing that is still open for reading."""
    path, answers = tmp_path / "iqtt-test.h5", tmp_path / "iqtt-test-answers.h5"
    errors = []
    for name in (path.name, answers.name):
        shutil.copy(split_folder / name, tmp_path / name)
    with open_questions(path, answers=answers) as questions:
        assert questions.has_answers
    for arguments in (
        {"part": "labeled"},
        {"answers": split_folder / "iqtt-val.h5"},
        {"answers": tmp_path / "none.h5"},
    ):
        with pytest.raises((FileFormatError, SpecError, OSError)) as error:
            open_questions(path, **arguments)
        errors.append(error)  # and with it the frames that it passed through
    with h5py.File(path, "r+"), h5py.File(answers, "r+") as file:
        del file["truth/distractor_kind"].attrs["names"]
    with pytest.raises(FileFormatError, match="damaged") as error:
        AnswersFile(answers)
    with h5py.File(answers, "r+"):
        assert len(errors) == 3

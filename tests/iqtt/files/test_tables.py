"""Files that are no question files, or damaged ones: one clear error each, nothing kept open."""

import json
import math
import os
import shutil

import h5py
import numpy as np
import pytest
from h5_edits import attribute, claims, gone, grouped, linked
from iqtt.files.tables import NoImagesError

from iqtt.files.reader import AnswersFile, open_questions, parts
from scenegen.common.errors import FileFormatError, SpecError


def refused(path, place, read=open_questions) -> FileFormatError:
    """Check that a file is refused in one line that says where it is wrong; return the error."""
    with pytest.raises(FileFormatError) as error:
        read(path)
    assert error.value.where.startswith(f"{path}: {place}" if place else str(path))
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400
    return error.value


def as_version_1(minor: int):
    """Return an edit that makes of a file one as the format 1 was: no cameras, no task."""

    def edit(file: h5py.File) -> None:
        spec = json.loads(file.attrs["spec"])
        del (
            spec["answers"],
            spec["min_sight_angle_degrees"],
            file.attrs["task"],
            file["truth/camera_distance"],
        )
        file.attrs["spec"] = json.dumps(spec)
        file.attrs["format_version"] = f"1.{minor}"
        if minor < 2:
            del file.attrs["content_digest"], file.attrs["truth_digest"]

    return edit


@pytest.mark.parametrize("minor", [0, 2])
def test_files_of_format_1_are_read_with_the_one_camera_that_they_had(damaged, minor):
    path = damaged(as_version_1(minor))
    with open_questions(path) as questions:
        expected = 1.02 * 3.5 / math.sin(math.radians(14))
        assert questions.answers == 3
        assert questions.spec.min_sight_angle_degrees == 0
        assert questions.read("camera_distance", slice(None)) == pytest.approx([expected] * 6)
        assert questions[5].truth.camera.position == pytest.approx((0, 0, expected))
        assert questions[5].truth.cubes.shape[0] == 4
    with open_questions(damaged(lambda file: None)) as questions:
        stored = questions.read("camera_distance", slice(None))
        assert len(set(stored.tolist())) > 1
        assert questions[2].truth.camera.position == (0, 0, stored[2])


def test_versions_there_are_not(damaged):
    for version in ("0.9", "3.0", "1.x", "2.", "11.0"):
        refused(damaged(lambda file, v=version: attribute("format_version", v)(file)), "")


@pytest.mark.parametrize("distance", [0.0, -1.0, np.nan, np.inf, 1e300])
def test_cameras_that_cannot_be(damaged, distance):
    def edit(file: h5py.File) -> None:
        file["truth/camera_distance"][3] = distance

    with open_questions(damaged(edit)) as questions, pytest.raises(FileFormatError) as error:
        questions.truth(3)
    assert "camera_distance, row 3" in error.value.where


@pytest.mark.parametrize("read", [open_questions, parts, AnswersFile])
def test_what_is_no_file(tmp_path, read):
    os.mkfifo(tmp_path / "pipe.h5")  # which must not be waited for
    for name, kind in (
        ("none.h5", FileNotFoundError),
        ("", IsADirectoryError),
        ("pipe.h5", OSError),
    ):
        with pytest.raises(kind) as error:
            read(tmp_path / name)
        assert error.value.filename == str(tmp_path / name)


@pytest.mark.parametrize("content", [b"", b"hello\n" * 50, b"\x89HDF\r\n\x1a\n" + bytes(500)])
def test_no_hdf5(tmp_path, content):
    (tmp_path / "x.h5").write_bytes(content)
    assert "errno" not in str(refused(tmp_path / "x.h5", ""))


@pytest.mark.parametrize("part", [0.001, 0.3, 0.9, 0.999])
def test_truncated(split_folder, tmp_path, part):
    data = (split_folder / "iqtt-val.h5").read_bytes()
    (tmp_path / "x.h5").write_bytes(data[: int(len(data) * part)])
    refused(tmp_path / "x.h5", "")


def test_files_of_other_kinds(tmp_path, rooms_path):
    for read in (open_questions, parts):
        error = refused(rooms_path, "attribute 'format'", read=read)
        assert error.found == "'pix2shape-bench/rooms'"
    h5py.File(tmp_path / "x.h5", "w").close()
    refused(tmp_path / "x.h5", "")


def test_answers_alone(split_folder, tmp_path):
    path = split_folder / "iqtt-test-answers.h5"
    assert "iqtt-test.h5" in refused(path, "").hint
    with pytest.raises(NoImagesError):
        parts(path)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["answers"] = [0, 1]
    assert isinstance(refused(tmp_path / "a.h5", ""), NoImagesError)
    refused(split_folder / "iqtt-test.h5", "", read=AnswersFile)


def test_parts_that_are_not_there(split_folder):
    train, val = split_folder / "iqtt-train.h5", split_folder / "iqtt-val.h5"
    for path, part in ((train, None), (train, ""), (train, "validation"), (val, "labeled")):
        with pytest.raises(SpecError) as error:
            open_questions(path, part)
        assert error.value.where == f"{path}: part"
        assert error.value.found == (part or "none")
        assert ("labeled or unlabeled" in error.value.expected) == (path == train)


IMAGES, ONE = np.zeros((6, 4, 32, 32, 3), np.uint8), np.zeros(6, np.uint8)


def put(name, values):
    def edit(file):
        del file[name]
        file[name] = values

    return edit


NAMES = "truth/distractor_kind: attribute 'names'"


def named(names):
    return lambda file: file["truth/distractor_kind"].attrs.update(names=names)


def padded_spec(file):
    """HDF5 keeps attributes of 64 kB; where a text is longer, it lies elsewhere in the file."""
    file.attrs["spec"] = file.attrs["spec"] + " " * 4_000_000


OURS = {
    "other format": (attribute("format", "other"), "attribute 'format'"),
    "format is an array": (attribute("format", np.arange(3)), "attribute 'format'"),
    "newer": (attribute("format_version", "3.1"), ""),
    "no version": (gone("format_version"), ""),
    "no writer": (gone("writer"), "attribute 'writer'"),
    "no spec": (gone("spec"), "attribute 'spec'"),
    "spec is garbage": (attribute("spec", "garbage"), "attribute 'spec'"),
    "spec is a list": (attribute("spec", "[]"), "attribute 'spec'"),
    "spec of the future": (attribute("spec", '{"fog": 1}'), "attribute 'spec'"),
    "spec of another size": (attribute("spec", "{}"), "questions"),
    "no split": (gone("split"), "attribute 'split'"),
    "unknown split": (attribute("split", "dev"), "attribute 'split'"),
    "no fingerprint": (gone("fingerprint"), "attribute 'fingerprint'"),
    "fingerprint is an array": (attribute("fingerprint", np.arange(9)), "attribute 'fingerprint'"),
    "questions gone": (gone("questions"), ""),
    "questions is a group": (grouped("questions"), "questions"),
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
    "a dead link": (linked("answers", h5py.SoftLink("/nothing")), ""),
    "no names": (lambda f: f["truth/distractor_kind"].attrs.pop("names"), NAMES),
    "names are numbers": (named([0, 1, 2]), NAMES),
    "one name": (named("near"), NAMES),
    "many names": (named(["near"] * 101), NAMES),
    "names that cannot be printed": (named(["near", "\x1b[2J", "other"]), NAMES),
    "a version without a minor one": (attribute("format_version", "1.x"), "attribute 'format_ver"),
    "command is an array": (attribute("creation_command", np.arange(3)), "attribute 'creation_co"),
    "variant of two lines": (attribute("variant", "a\nb"), "attribute 'variant'"),
    "a long writer": (attribute("writer", "w" * 1001), "attribute 'writer'"),
    "a long spec": (padded_spec, "attribute 'spec'"),
    "no content digest": (gone("content_digest"), "attribute 'content_digest'"),
    "no truth digest": (gone("truth_digest"), "attribute 'truth_digest'"),
    "no hexadecimal digest": (attribute("truth_digest", "x" * 64), "attribute 'truth_digest'"),
}


@pytest.mark.parametrize("name", OURS)
def test_damaged_layouts(damaged, name):
    edit, place = OURS[name]
    refused(damaged(edit), place)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("cube_count", 8, "1 to 7"),
        ("cube_count", 0, "1 to 7"),
        ("light_count", 3, "0 to 2"),
        ("light_count", -1, "0 to 2"),
        ("distractor_kind", 4, "-1 to 3"),
        ("distractor_kind", -2, "-1 to 3"),
        ("angle_degrees", np.nan, "0 to 180"),
        ("angle_degrees", 181, "0 to 180"),
    ],
)
def test_damaged_truth_of_one_row(damaged, name, value, expected):
    path = damaged(lambda file: file[f"truth/{name}"].__setitem__(4, value))
    with open_questions(path) as questions:
        assert questions[3].truth is not None
        with pytest.raises(FileFormatError) as error:
            questions[4]
    assert (error.value.where, error.value.expected) == (f"{path}: {name}, row 4", expected)
    with open_questions(path) as questions, pytest.raises(FileFormatError) as error:
        questions.read(name, slice(1, None))
    assert (error.value.where, error.value.expected) == (f"{path}: {name}, row 4", expected)


def test_a_damaged_chunk_spoils_its_row_only(damaged):
    def scribble(file):
        file["questions"].id.write_direct_chunk((2, 0, 0, 0, 0), b"\x00" * 40)

    path = damaged(scribble)
    with open_questions(path) as questions:
        assert questions[1].images.shape == questions[3].images.shape
        for rows, where in ((2, "questions, row 2"), (slice(1, None), "questions, rows 1 to 5")):
            refused(path, where, read=lambda _, rows=rows: questions.read("questions", rows))


FLOATS = np.zeros((5, 4, 8, 8, 3), np.float32)


@pytest.mark.parametrize(
    "questions",
    [
        FLOATS[..., 0],
        FLOATS[:, :3],
        FLOATS[:, :, :0],
        np.float32(3),
        h5py.Empty("f4"),
        FLOATS.astype(np.int16),
        FLOATS.astype(np.float64),
        FLOATS + 255,
        FLOATS * np.nan,
        FLOATS - 0.5,
    ],
)
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
    errors.append(refused(answers, "", read=AnswersFile))
    with h5py.File(answers, "r+"), h5py.File(path, "r+"):
        assert len(errors) == 4

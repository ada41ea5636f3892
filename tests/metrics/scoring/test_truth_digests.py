"""Which truth was scored: its digest, who chose it, and truths that were changed."""

import hashlib
import shutil

import h5py
import numpy as np
import pytest
from h5_edits import put, replaced
from refusals import refused
from submissions import good_answers, good_rooms

from metrics.prediction_writer import RoomPredictionWriter
from metrics.scoring import known_tests
from metrics.scoring.evaluate import score
from metrics.scoring.known_tests import KnownTest
from metrics.scoring.runs import ScoringError, Settings
from scenegen.common.errors import FileFormatError
from scenegen.layout import SCORED, TRUTH_DIGEST
from scenegen.rooms.reader import RoomsFile


@pytest.fixture
def truth(truths, tmp_path):
    """A copy of the rooms that a test may change, and a good submission for it."""
    shutil.copy(truths.rooms, tmp_path / "truth.h5")
    good_rooms(tmp_path, tmp_path / "truth.h5")
    return tmp_path / "truth.h5"


@pytest.fixture
def answers(truths, tmp_path):
    """The same of questions."""
    beside = truths.iqtt.with_name("iqtt-test-answers.h5")
    shutil.copy(beside, tmp_path / "truth.h5")
    good_answers(tmp_path, truths.iqtt)
    return tmp_path / "truth.h5"


def by_hand(file, names, group=""):
    """The digest as docs/rooms-file.md tells it, with plain h5py."""
    lines = []
    for name in sorted(names):
        values = file[f"{group}{name}" if name != "answers" else name]
        rows = b"".join(hashlib.sha256(row.tobytes()).digest() for row in values)
        lines.append(f"{name} {hashlib.sha256(rows).hexdigest()}\n")
    return hashlib.sha256("".join(lines).encode()).hexdigest()


@pytest.mark.parametrize("processes", [1, 2])
def test_scores_name_the_digest_of_the_rooms_that_were_read(truth, processes):
    meta = score([truth.with_name("predictions.h5")], truth, Settings(processes=processes)).meta
    with h5py.File(truth) as file:
        assert meta.truth_digest == file.attrs[TRUTH_DIGEST] == by_hand(file, SCORED)
    assert meta.truth_source == "given"


def test_rows_that_are_not_scored_count_too(truth, tmp_path):
    path = tmp_path / "part.h5"
    with (
        RoomsFile(truth) as rooms,
        RoomPredictionWriter(path, truth, method="part", allow_partial=True) as out,
    ):
        out.add(3, rooms.read("depth", 3))
        stored = rooms.attributes[TRUTH_DIGEST]
    partial = Settings(allow_partial=True)
    assert score([path], truth, partial).meta.truth_digest == stored
    with h5py.File(truth, "r+") as file:
        put("normal", (5, 0, 0), (0.0, 0.6, 0.8))(file)
    with refused(ScoringError, f"{truth}: {TRUTH_DIGEST}", hint="normal"):
        score([path], truth, partial)


def test_scores_name_the_digest_of_the_answers_that_were_read(answers):
    meta = score([answers.with_name("answers.h5")], answers).meta
    with h5py.File(answers) as file:
        names = ("answers", "distractor_kind", "angle_degrees")
        assert meta.truth_digest == by_hand(file, names, "truth/") == file.attrs[TRUTH_DIGEST]


SOME = {"depth": 2.0, "normal": (0.0, 0.6, 0.8), "object_id": 7}


@pytest.mark.parametrize("name", SCORED)
def test_changed_rooms_are_refused(name, truth):
    path = truth.with_name("predictions.h5")
    with h5py.File(truth, "r+") as file:
        if name in SOME:
            put(name, (5, 0, 0), SOME[name])(file)
        else:
            change = np.nextafter if file[name].dtype.kind == "f" else np.add
            put(name, 5, change(file[name][5], 9))(file)
            put(name, (5, 3), (0, 0, 0, 1))(file) if name.endswith("from_camera") else None
    with refused(ScoringError, f"{truth}: {TRUTH_DIGEST}", hint=f": {name}"):
        score([path], truth)


def test_changed_answers_are_refused(answers):
    path = answers.with_name("answers.h5")
    with h5py.File(answers, "r+") as file:
        file["truth/angle_degrees"][3] += 1.0
    with refused(ScoringError, f"{answers}: {TRUTH_DIGEST}", hint="angle_degrees"):
        score([path], answers)


def test_kinds_of_wrong_answers_belong_to_wrong_answers(answers):
    with h5py.File(answers, "r+") as file:
        file["truth/distractor_kind"][3] = -1
    with refused(FileFormatError, f"{answers}: distractor_kind, row 3"):
        score([answers.with_name("answers.h5")], answers)


def test_a_truth_that_only_the_submission_names_is_not_comparable(truth, monkeypatch):
    """Forged depth under the true fingerprint, say, and a submission that fits it."""
    path = truth.with_name("predictions.h5")
    found = score([path])
    digest = found.meta.truth_digest
    assert (found.comparable, found.meta.truth_source) == (False, "submission")
    (warning,) = found.warnings
    assert all(word in warning for word in (str(truth), digest[:12], "--truth"))
    assert score([path], truth).comparable
    known = KnownTest("mine", "rooms", digest, 8, "scenegen render")
    monkeypatch.setattr(known_tests, "KNOWN_TESTS", (known,))
    found = score([path])
    assert (found.comparable, found.meta.truth_source, found.warnings) == (True, "known", ())
    assert score([path], truth).meta.truth_source == "given"


def test_how_values_are_packed_does_not_matter(truth):
    before = score([truth.with_name("predictions.h5")], truth).meta.truth_digest
    with h5py.File(truth, "r+") as file:
        replaced("depth", lambda values: values)(file)
    assert score([truth.with_name("predictions.h5")], truth).meta.truth_digest == before

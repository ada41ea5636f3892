"""The digest of a truth, made of the values that were read to score, and held against the file's.

docs/rooms-file.md and docs/iqtt.md say which data sets it covers.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from metrics.measured.reader import Images, MeasuredFile
from metrics.scoring.known_tests import Task
from metrics.scoring.records import ScoreFile
from metrics.scoring.runs import ScoringError
from metrics.submissions.truths import TrueView
from scenegen.files.content import column_digest, dataset_digest, joint_digest, row_digest
from scenegen.layout import TRUTH_DIGEST
from scenegen.rooms.reader import RoomsFile

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile

LAYERS = ("layers/depth", "layers/object_id", "layers/entering")
PER_PIXEL = ("depth", "normal", "object_id", *LAYERS)
RowDigests = tuple[bytes, ...]  # of PER_PIXEL, or of the first ones


class OtherTruthError(ScoringError):
    """Scores of another truth than is asked for."""


def view_digests(view: TrueView) -> RowDigests:
    """Return the digests of depth, normal and object_id of a row that were read to be scored."""
    return tuple(row_digest(getattr(view, name)) for name in PER_PIXEL[:3])


def stored_digest(truth: "Images | AnswersFile") -> str | None:
    """Return the digest that an open truth states of itself; None where it states none."""
    if isinstance(truth, RoomsFile):
        digest = truth.attributes.get("truth_digest")
        return digest if isinstance(digest, str) else None
    return truth.stored_truth_digest


def stated_truth(truth: "Images | AnswersFile") -> tuple[Task, str | None]:
    """Return what an open truth says that it is, as `ScoreFile.truth`; None for no digest.

    Of measured truth the protocol is missing, which is no affair of the truth.
    """
    measured: Task = "measured" if isinstance(truth, MeasuredFile) else "iqtt"
    return "rooms" if isinstance(truth, RoomsFile) else measured, stored_digest(truth)


def require_truth(
    file: ScoreFile, truth: tuple[Task, str | None], owner: object, protocol: str | None = None
) -> None:
    """Raise OtherTruthError unless a score file is of this truth, that of `owner`.

    This is the rule for "the same test set": one task, and one digest of what scores depend on.
    Where a protocol is given, "" for none, the file's must be the same.
    """
    if protocol not in (None, file.protocol):
        found, expected = f"scores under the protocol {file.protocol}", f"{protocol}, as {owner}"
        hint = f"use bench score --protocol {protocol}"
        raise OtherTruthError(file.place, found, expected, hint)
    if file.truth != truth:
        found, expected = (
            f"scores of {task}, ground truth with hash {digest or 'none':.12}"
            for task, digest in (file.truth, truth)
        )
        expected = f"{expected}, as {owner} has"
        raise OtherTruthError(file.place, found, expected, "use bench score --truth with this file")


def images_digest(truth: Images, scored: Mapping[int, RowDigests]) -> str:
    """Return the digest of rooms or measured truth, some rows of which were scored.

    The others are read here.

    Raises ScoringError where it is not the one that was written with the file.
    """
    columns = {}
    for name in truth.SCORED:
        if name not in truth.fields:  # layers; and measured truth may have no normals
            continue
        if name in PER_PIXEL:
            place = PER_PIXEL.index(name)
            columns[name] = column_digest(
                scored[row][place]
                if len(scored.get(row, ())) > place
                else row_digest(truth.read(name, row))
                for row in range(len(truth))
            )
        else:
            columns[name] = dataset_digest(truth.read(name, slice(None)))
    return _checked(truth.path, columns, truth.stored_truth_digest, truth.stored_digests())


def answers_digest(truth: "AnswersFile", columns: Mapping[str, NDArray[Any]]) -> str:
    """Return the digest of the answers and what else their scores depend on, columns of Q rows.

    Raises ScoringError where it is not the one that was written with the file.
    """
    digests = {name: dataset_digest(rows) for name, rows in columns.items()}
    stored = {name: digest for name, digest in truth.stored_digests().items() if name in columns}
    return _checked(truth.path, digests, truth.stored_truth_digest, stored)


def _checked(
    path: Path, digests: Mapping[str, str], expected: str | None, stored: Mapping[str, str]
) -> str:
    """Return the joint digest of columns. Raises ScoringError where it is not the expected one."""
    digest = joint_digest(digests)
    if expected is None or expected == digest:  # released files have none
        return digest
    changed = [name for name in stored if stored[name] != digests.get(name, stored[name])]
    raise ScoringError(
        f"{path}: {TRUTH_DIGEST}",
        f"content with hash {digest:.12}",
        f"{expected!s:.12}, with which the file was written",
        f"changed since: {', '.join(changed)}" if changed else "",
    )


def file_digests(path: Path, task: str) -> tuple[str, str, int]:
    """Return the digests of a file's truth, from all its values, and of its pictures; and its rows.

    The pictures of a file of answers lie beside it. Their digest is the one stored with them.

    Raises FileFormatError for a file that is none, and ScoringError as `images_digest`.
    """
    if task == "rooms":
        with RoomsFile(path) as rooms:
            return images_digest(rooms, {}), rooms.stored_digests()["image"], len(rooms)
    from iqtt.files.layout import SCORED as OF_ANSWERS
    from iqtt.files.reader import AnswersFile, QuestionsFile

    with QuestionsFile(path.with_name(path.name.replace("-answers", ""))) as questions:
        pictures = questions.stored_digests()["questions"]
    with AnswersFile(path) as answers:
        names = [name for name in OF_ANSWERS if name in answers.fields]
        columns = {name: answers.read(name, slice(None)) for name in names}
        return answers_digest(answers, columns), pictures, len(answers)

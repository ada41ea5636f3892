"""Everything that is wrong with a submission, at once: `bench validate`."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.submissions.hints.hints import answer_hints, room_hints
from metrics.submissions.missing_rows import match_problems, size_problems
from metrics.submissions.problems import MOST_IDS, Problem
from metrics.submissions.reader import (
    QuestionPredictions,
    RoomPredictions,
    find_truth,
    inspect_predictions,
)
from metrics.submissions.row_rules import EXPECTED, GOT, depth_faults, normal_faults
from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.rooms.reader import RoomsFile

__all__ = ["Problem", "validate"]

Array = NDArray[Any]


def validate(
    path: str | Path,
    truth_path: str | Path | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Problem]:
    """Return everything that is wrong with a submission, and hints; empty where all is well.

    Reads one row at a time, of a submission and its truth. Problems come in the order in which
    one would mend them; hints (`Problem.is_hint`) come last, and leave a submission valid.

    Args:
        path: the submission, HDF5 or JSON.
        truth_path: its truth; by default the one that the submission names (`find_truth`).
        progress: told after every row, 1 each time.

    Raises OSError where `path` is no file. What is wrong inside is told, never raised.
    """
    try:
        predictions, problems = inspect_predictions(path)
    except FileFormatError as error:
        return [Problem("file", "format", "HDF5, or JSON for iqtt", _short(error, path))]
    if predictions is None:
        return problems
    with predictions:
        try:
            truth = find_truth(predictions, truth_path)
            if isinstance(predictions, RoomPredictions):
                return problems + _against_rooms(predictions, truth, progress)
            return problems + _against_questions(predictions, truth)
        except (SceneGenError, OSError) as error:
            got = _short(error, path)
            return [*problems, Problem("truth", "readable", "the file that is predicted", got)]


def _against_rooms(
    predictions: RoomPredictions, truth_path: Path, progress: Callable[[int], Any]
) -> list[Problem]:
    with RoomsFile(truth_path) as truth:
        problems = match_problems(predictions, truth_path, truth.fingerprint, len(truth))
        if not any(problem.dataset == "truth_fingerprint" for problem in problems):
            problems += size_problems(predictions, truth)
        if any(problem.rule in ("match", "shape") for problem in problems):
            return problems
        tally = _Tally()
        for i, row in enumerate(predictions.rows.tolist()):
            if 0 <= row < len(truth):
                _check_row(predictions, i, row, truth, tally)
            progress(1)
        return [*problems, *tally.problems(), *room_hints(predictions, truth)]


def _check_row(
    predictions: RoomPredictions, i: int, row: int, truth: RoomsFile, tally: "_Tally"
) -> None:
    mask = np.isfinite(truth.read("depth", row))
    reads: list[tuple[str, Callable[[int], Array], Callable[[Array, Array], dict[str, Array]]]]
    reads = [("depth", predictions.depth, depth_faults)]
    if predictions.has_normals:
        reads.append(("normal", predictions.normal, normal_faults))
    for name, read, faults in reads:
        try:
            values = read(i)
        except FileFormatError as error:
            tally.add(name, "readable", row, 1, str(error).rsplit(": ", maxsplit=1)[-1])
            continue
        for rule, at in faults(values, mask).items():
            tally.add(name, rule, row, int(np.count_nonzero(at)))


def _against_questions(predictions: QuestionPredictions, truth_path: Path) -> list[Problem]:
    from iqtt.files.reader import AnswersFile

    with AnswersFile(truth_path) as truth:
        problems = match_problems(predictions, truth_path, truth.fingerprint, len(truth))
        if any(problem.rule == "match" for problem in problems):
            return problems
        return problems + answer_hints(predictions, truth.read("answers", slice(None)))


class _Tally:
    """Counts of broken rules: pixels, rows, and the first few rows."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], list[Any]] = {}

    def add(self, dataset: str, rule: str, row: int, pixels: int, why: str = "") -> None:
        entry = self._found.setdefault((dataset, rule), [0, 0, [], why])
        entry[0] += pixels
        entry[1] += 1
        if len(entry[2]) < MOST_IDS:
            entry[2].append(row)

    def problems(self) -> Iterator[Problem]:
        for (dataset, rule), (pixels, rows, ids, why) in sorted(self._found.items()):
            if rule == "readable":
                got, expected = f"{rows} rows {why}", "rows that can be read"
            else:
                got, expected = f"{GOT[rule]} at {pixels} pixels of {rows} rows", EXPECTED[rule]
            yield Problem(dataset, rule, expected, got, tuple(ids))


def _short(error: Exception, path: str | Path) -> str:
    """What an error says, without the submission's own name before it."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error).removeprefix(f"{path}: ")

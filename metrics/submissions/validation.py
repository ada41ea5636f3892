"""`validate` returns everything that is wrong with a submission, for `bench validate`."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from metrics.submissions.hints.questions import answer_hints
from metrics.submissions.hints.rooms import room_hints
from metrics.submissions.missing_rows import (
    candidate_problems,
    match_problems,
    size_problems,
)
from metrics.submissions.problems import HINT, MOST_IDS, Problem
from metrics.submissions.reader import (
    QuestionPredictions,
    RoomPredictions,
    inspect_predictions,
)
from metrics.submissions.rules import EXPECTED, FOUND, Array, depth_faults, normal_faults
from metrics.submissions.truths import FoundTruth, find_truth, read_true_view
from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.rooms.reader import RoomsFile

__all__ = ["Problem", "validate"]


def validate(
    path: str | Path,
    truth_path: str | Path | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Problem]:
    """Return everything that is wrong with a submission, and hints; empty where all is well.

    Rows are read one at a time. Problems come in the order in which one would mend them; hints
    (`Problem.is_hint`) come last, and leave a submission valid.

    Args:
        path: the submission, HDF5 or JSON.
        truth_path: its truth; by default the one that the submission names (`find_truth`), which a
            hint then says.
        progress: called with 1 after every row.

    Raises OSError where `path` is no file. What is wrong inside is returned, never raised.
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
                problems += _against_rooms(predictions, truth.path, progress)
            else:
                problems += _against_questions(predictions, truth.path)
            return problems + _hints_on_source(truth)
        except (SceneGenError, OSError) as error:
            found, expected = _short(error, path), "the file that is predicted"
            if isinstance(error, SceneGenError) and error.expected == expected:
                found = error.found + (f" ({error.hint})" if error.hint else "")
            return [*problems, Problem("truth", "readable", expected, found)]


def _hints_on_source(truth: FoundTruth) -> list[Problem]:
    """Return a hint where nobody but the submission says that this is the truth."""
    if truth.source == "given":
        return []
    found = f"{truth.path}, which was used because the submission names it"
    expected = f"--truth {truth.path} if it is the right file; else scores are not ranked"
    return [Problem("truth", HINT, expected, found)]


def _against_rooms(
    predictions: RoomPredictions, truth_path: Path, progress: Callable[[int], Any]
) -> list[Problem]:
    with RoomsFile(truth_path) as truth:
        problems = match_problems(predictions, truth_path, truth.fingerprint, len(truth))
        if not any(problem.dataset == "truth_fingerprint" for problem in problems):
            problems += size_problems(predictions, truth)
        if any(problem.rule in ("match", "shape") for problem in problems):
            return problems
        tallies: dict[tuple[str, str], _Tally] = defaultdict(_Tally)
        for i, row in enumerate(predictions.rows.tolist()):
            if 0 <= row < len(truth):
                for name, rule, pixels, why in _faults(predictions, i, row, truth):
                    tallies[name, rule].add(row, pixels, why)
            progress(1)
        counted = [tally.problem(*key) for key, tally in sorted(tallies.items())]
        return [*problems, *counted, *room_hints(predictions, truth)]


def _faults(
    predictions: RoomPredictions, i: int, row: int, truth: RoomsFile
) -> Iterator[tuple[str, str, int, str]]:
    """Yield dataset, rule, number of pixels, and why a row cannot be read where that is so."""
    mask = read_true_view(truth, row).mask
    rules: list[tuple[str, Callable[[int], Array], Callable[[Array, Array], dict[str, Array]]]]
    rules = [("depth", predictions.depth, depth_faults)]
    if predictions.has_normals:
        rules.append(("normal", predictions.normal, normal_faults))
    for name, read, faults in rules:
        try:
            values = read(i)
        except FileFormatError as error:
            place = f"{predictions.path}: {name}, row {row}: "
            yield name, "readable", 1, str(error).removeprefix(place)
            continue
        for rule, at in faults(values, mask).items():
            yield name, rule, int(np.count_nonzero(at)), ""


@dataclass
class _Tally:
    """How often a rule is broken; of the rows only the first few are kept."""

    pixels: int = 0
    rows: int = 0
    why: str = ""
    ids: list[int] = field(default_factory=list)

    def add(self, row: int, pixels: int, why: str) -> None:
        self.pixels, self.rows, self.why = self.pixels + pixels, self.rows + 1, self.why or why
        if self.rows <= MOST_IDS:
            self.ids.append(row)

    def problem(self, dataset: str, rule: str) -> Problem:
        found, expected = f"{self.rows} rows {self.why}", "rows that can be read"
        if rule != "readable":
            found = f"{FOUND[rule]} at {self.pixels} pixels of {self.rows} rows"
            expected = EXPECTED[rule]
        return Problem(dataset, rule, expected, found, tuple(self.ids))


def _against_questions(predictions: QuestionPredictions, truth_path: Path) -> list[Problem]:
    from iqtt.files.reader import AnswersFile, NoAnswersError, QuestionsFile

    try:
        truth_file: AnswersFile | QuestionsFile = AnswersFile(truth_path)
    except NoAnswersError:  # those who take part have the questions alone
        truth_file = QuestionsFile(truth_path)
    with truth_file as truth:
        problems = match_problems(predictions, truth_path, truth.fingerprint, len(truth))
        if any(problem.rule == "match" for problem in problems):
            return problems
        wrong = candidate_problems(predictions, truth.answers)
        problems += wrong
        if wrong or not truth.has_answers:
            return problems
        return problems + answer_hints(predictions, truth.read("answers", slice(None)))


def _short(error: Exception, path: str | Path) -> str:
    """Return the text of an error without the submission's own name before it."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error).removeprefix(f"{path}: ")

"""`validate` returns everything that is wrong with a submission, for `bench validate`."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from metrics.measured.reader import Images, open_images
from metrics.submissions.hints.no_value import no_value_hints
from metrics.submissions.hints.tasks import answer_hints, room_hints
from metrics.submissions.problems import HINT, MOST_IDS, Problem
from metrics.submissions.reader import (
    Predictions,
    QuestionPredictions,
    RoomPredictions,
    inspect_predictions,
)
from metrics.submissions.rules import Against, broken_rules
from metrics.submissions.truths import FoundTruth, find_truth, match_problems, surface_of
from scenegen.common.errors import FileFormatError, SceneGenError


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
                others = _against_questions(predictions, truth.path)
                problems += [problem for problem in others if problem not in problems]
            return problems + _hints_on_source(truth)
        except (SceneGenError, OSError) as error:
            found, expected = _short(error, path), "the file that is predicted"
            if isinstance(error, SceneGenError) and error.expected == expected:
                found = error.found + (f" ({error.hint})" if error.hint else "")
            return [*problems, Problem("truth", "readable", expected, found)]


def hints(predictions: Predictions, truth: Any) -> list[Problem]:
    """Return hints on likely mistakes of a submission that fits its truth, an open file.

    Raises FileFormatError where the truth is damaged.
    """
    if isinstance(predictions, RoomPredictions):
        return no_value_hints(predictions, truth) + room_hints(predictions, truth)
    assert isinstance(predictions, QuestionPredictions)
    return answer_hints(predictions, truth.read("answers", slice(None)))


def _hints_on_source(truth: FoundTruth) -> list[Problem]:
    """Return a hint where nobody but the submission says that this is the truth."""
    if truth.source == "given":
        return []
    found = f"{truth.path}, the path stored in the predictions"
    expected = f"--truth {truth.path} if this file is correct; else scores are not ranked"
    return [Problem("truth", HINT, expected, found)]


def _against_rooms(
    predictions: RoomPredictions, truth_path: Path, progress: Callable[[int], Any]
) -> list[Problem]:
    with open_images(truth_path) as truth:
        problems = match_problems(predictions, truth)
        if any(problem.rule in ("match", "shape") for problem in problems):
            return problems
        tallies: dict[tuple[str, str], _Tally] = {}
        for i, row in enumerate(predictions.rows.tolist()):
            if 0 <= row < len(truth):
                for problem, pixels in _row_problems(predictions, i, row, truth):
                    key = problem.dataset, problem.rule
                    tallies.setdefault(key, _Tally(problem)).add(row, pixels)
            progress(1)
        counted = [tally.total for _, tally in sorted(tallies.items())]
        return [*problems, *counted, *hints(predictions, truth)]


def _row_problems(
    predictions: RoomPredictions, i: int, row: int, truth: Images
) -> Iterator[tuple[Problem, int]]:
    """Yield what is wrong with the values of a row, and at how many pixels."""
    surface = surface_of(truth, row)
    height, width = surface.shape
    readers = {predictions.kind: predictions.geometry}
    if predictions.has_normals:
        readers["normal"] = predictions.normal
    if predictions.has_confidence:
        readers["confidence"] = predictions.confidence
    if predictions.has_surface_points:
        readers["surface_points"] = predictions.surface_points
    for name, read in readers.items():
        try:
            values = read(i) if name == "surface_points" else read(i)[:height, :width]
        except FileFormatError as error:
            why = str(error).removeprefix(f"{predictions.path}: {name}, row {row}: ")
            yield Problem(name, "readable", "rows that can be read", why), 0
            continue
        for rule, wrong in broken_rules(name, values, Against(surface=surface)):
            problem = Problem(name, rule.name, rule.expected, rule.found)
            yield problem, int(np.count_nonzero(wrong))


@dataclass
class _Tally:
    """How often a rule is broken; of the rows only the first few are kept."""

    problem: Problem
    pixels: int = 0
    rows: int = 0
    ids: list[int] = field(default_factory=list)

    def add(self, row: int, pixels: int) -> None:
        self.pixels, self.rows = self.pixels + pixels, self.rows + 1
        if self.rows <= MOST_IDS:
            self.ids.append(row)

    @property
    def total(self) -> Problem:
        """The problem of all rows."""
        found = f"{self.rows} rows {self.problem.found}"
        if self.pixels:
            found = f"{self.problem.found} at {self.pixels} pixels of {self.rows} rows"
        return replace(self.problem, found=found, ids=tuple(self.ids))


def _against_questions(predictions: QuestionPredictions, truth_path: Path) -> list[Problem]:
    from iqtt.files.reader import AnswersFile, NoAnswersError, QuestionsFile

    try:
        truth_file: AnswersFile | QuestionsFile = AnswersFile(truth_path)
    except NoAnswersError:  # those who take part have the questions alone
        truth_file = QuestionsFile(truth_path)
    with truth_file as truth:
        problems = match_problems(predictions, truth)
        if not truth.has_answers or any(p.rule in ("match", "shape") for p in problems):
            return problems
        return problems + hints(predictions, truth)


def _short(error: Exception, path: str | Path) -> str:
    """Return the text of an error without the submission's own name before it."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error).removeprefix(f"{path}: ")

"""What an HDF5 submission holds, and everything that is wrong with it, before any truth is known.

Nothing here raises on broken content. Ids and answers are read whole, pixels not at all.
"""

from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import ABSTAINED, CANDIDATES, answers_from_scores
from metrics.measures.checks import LARGEST_MAGNITUDE
from metrics.submissions.datasets import names, open_dataset
from metrics.submissions.layout import ID_NAMES, datasets
from metrics.submissions.problems import Problem, first_ids
from metrics.submissions.texts import READ_ERRORS, read_texts
from scenegen.common.row_file import reason

Ids = NDArray[np.int64]
BLOCK_ROWS = 65_536


@dataclass
class Inspection:
    """What was found in a submission.

    Attributes:
        texts: its root attributes.
        task: "rooms" or "iqtt"; None where it is neither.
        ids: (M,) int64, rows of the truth or indices of questions; None where they are unusable.
        found: the datasets that can be used, by name.
        answers: (M,) int64, of an iqtt submission; None where they are unusable.
        problems: all that is wrong.
    """

    texts: dict[str, str] = field(default_factory=dict)
    task: str | None = None
    ids: Ids | None = None
    found: dict[str, h5py.Dataset] = field(default_factory=dict)
    answers: Ids | None = None
    problems: list[Problem] = field(default_factory=list)


def inspect(file: h5py.File) -> Inspection:
    """Check attributes, layout, ids and answers of an open file; never raises on its content."""
    result = Inspection()
    result.texts, result.problems = read_texts(file)
    result.task = result.texts.get("task")
    if result.task is None:
        return result
    count = None
    for dataset in datasets(result.task):
        item, problems = open_dataset(file, dataset, count)
        result.problems += problems
        if item is not None:
            result.found[dataset.name] = item
            count = int(item.shape[0]) if dataset.name in ID_NAMES.values() else count
    if result.task == "iqtt":
        _require_answers(file, result)
    _take_ids(result, ID_NAMES[result.task])
    if result.task == "iqtt" and result.ids is not None:
        _take_answers(result, result.ids)
    return result


def as_doubles(values: NDArray[Any]) -> NDArray[np.float64]:
    """Stored floats in double precision; NaN of any make stays NaN, without a warning."""
    with np.errstate(invalid="ignore", over="ignore"):
        return values.astype(np.float64)


def id_problems(ids: Ids, name: str) -> list[Problem]:
    """Say which ids (M,) are negative or come twice; and that there are none."""
    if len(ids) == 0:
        return [Problem(name, "count", "at least one", "no rows")]
    problems = []
    negative = np.unique(ids[ids < 0])
    if len(negative):
        got = f"{len(negative)} negative"
        problems.append(Problem(name, "range", "0 or more", got, first_ids(negative)))
    values, counts = np.unique(ids, return_counts=True)
    twice = values[counts > 1]
    if len(twice):
        got = f"{len(twice)} given more than once"
        problems.append(Problem(name, "unique", "each once", got, first_ids(twice)))
    return problems


def answer_problems(answers: NDArray[Any], ids: Ids, name: str = "answer") -> list[Problem]:
    """Say which answers (M,) are not -1, 0, 1 or 2."""
    wrong = (answers < ABSTAINED) | (answers >= CANDIDATES)
    if not wrong.any():
        return []
    got = f"{np.count_nonzero(wrong)} outside -1 to 2, such as {answers[wrong][0]}"
    return [Problem(name, "range", "0, 1, 2, or -1", got, first_ids(ids[wrong]))]


def score_problems(scores: NDArray[Any], ids: Ids) -> list[Problem]:
    """Say which scores (M, 3) are not finite numbers."""
    wrong = ~(np.abs(scores) <= LARGEST_MAGNITUDE).all(axis=1)
    if not wrong.any():
        return []
    got = f"NaN, infinite or huge at {np.count_nonzero(wrong)} questions"
    return [Problem("scores", "finite", "finite numbers", got, first_ids(ids[wrong]))]


def agreement_problems(answers: Ids, from_scores: Ids, ids: Ids) -> list[Problem]:
    """Say where answers (M,) are not those of the highest scores."""
    differs = answers != from_scores
    if not differs.any():
        return []
    got = f"other than scores say at {np.count_nonzero(differs)} questions"
    expected = "the highest of scores, -1 where it is tied"
    return [Problem("answer", "agreement", expected, got, first_ids(ids[differs]))]


def _require_answers(file: h5py.File, result: Inspection) -> None:
    known = {problem.dataset for problem in result.problems} | set(result.found)
    if not {"answer", "scores"} & known:
        got = f"neither; found {names(file)}"
        result.problems.append(Problem("answer", "present", "answer, or scores", got))


def _take_ids(result: Inspection, name: str) -> None:
    if name not in result.found:
        return
    try:
        values = result.found[name][()]
    except READ_ERRORS as error:
        got = f"cannot be read ({reason(error)})"
        result.problems.append(Problem(name, "readable", "integers", got))
        return
    if values.dtype == np.uint64 and values.size and values.max() > np.iinfo(np.int64).max:
        got = f"numbers up to {values.max()}"
        result.problems.append(Problem(name, "range", "rows of the truth", got))
        return
    ids = values.astype(np.int64)
    result.problems += id_problems(ids, name)
    result.ids = ids if len(ids) else None


def _take_answers(result: Inspection, ids: Ids) -> None:
    """Read answers, and those that scores stand for, which must be the same."""
    taken: dict[str, Ids] = {}
    for name, read in (("answer", _read_answers), ("scores", _read_scores)):
        if name not in result.found:
            continue
        try:
            taken[name], problems = read(result.found[name], ids)
        except READ_ERRORS as error:
            got = f"cannot be read ({reason(error)})"
            problems = [Problem(name, "readable", "numbers", got)]
        result.problems += problems
        if problems:
            return
    if len(taken) == 2:
        result.problems += agreement_problems(taken["answer"], taken["scores"], ids)
    result.answers = next(iter(taken.values()), None)


def _read_answers(item: h5py.Dataset, ids: Ids) -> tuple[Ids, list[Problem]]:
    values = item[()]
    return values.astype(np.int64), answer_problems(values, ids)


def _read_scores(item: h5py.Dataset, ids: Ids) -> tuple[Ids, list[Problem]]:
    answers, problems = np.empty(len(ids), np.int64), []
    for start in range(0, len(ids), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        scores = as_doubles(item[rows])
        wrong = score_problems(scores, ids[rows])
        problems += wrong
        if not wrong:
            answers[rows] = answers_from_scores(scores)
    return answers, problems[:1]

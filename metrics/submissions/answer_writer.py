"""Write answers to the questions of a file; `metrics.prediction_writer` hands it on."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.answers import ABSTAINED, CANDIDATES, answers_from_scores
from metrics.submissions.array_checks import agreement_problems, answer_problems, score_problems
from metrics.submissions.layout import ID_NAMES
from metrics.submissions.parts import check_elsewhere, checked_floats, checked_texts, write_columns
from metrics.submissions.problems import PredictionError
from scenegen.common.row_file import and_more, new_file

Array = NDArray[Any]


def write_answers(
    path: str | Path,
    questions_file: str | Path,
    *,
    method: str,
    answer: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    run: str = "",
    notes: str = "",
    overwrite: bool = False,
) -> None:
    """Write answers to all questions of a file, in its order.

    Args:
        path: to write.
        questions_file: such as iqtt-test.h5, recorded as given.
        method, run, notes, overwrite: as for `RoomPredictionWriter`.
        answer: (Q,) integers: 0, 1 or 2, or -1 to abstain, which counts as wrong.
        scores: (Q, 3) floats: the highest wins, a tie for it abstains. Either or both; both must
            say the same.

    Raises:
        PredictionError: naming the questions, what was found and what was expected.
        OSError, FileFormatError, SpecError: either file, as `iqtt.QuestionsFile`.
    """
    texts = checked_texts(
        "iqtt", {"method": method, "run": run, "notes": notes, "truth_path": str(questions_file)}
    )
    check_elsewhere(path, questions_file)
    count, fingerprint = _questions(questions_file)
    if count == 0:
        raise PredictionError(f"{questions_file}: found no questions, expected at least one")
    values = _checked_answers(answer, scores, count, f"{path}")
    with new_file(path, overwrite) as file:
        file.attrs.update({**texts, "truth_fingerprint": fingerprint})
        write_columns(file, "iqtt", {ID_NAMES["iqtt"]: np.arange(count), **values})


def _checked_answers(
    answer: ArrayLike | None, scores: ArrayLike | None, count: int, where: str
) -> dict[str, Array]:
    """The datasets to write. Raises PredictionError."""
    ids = np.arange(count)
    values: dict[str, Array] = {}
    problems = []
    if scores is not None:
        values["scores"] = checked_floats(
            scores, (count, CANDIDATES), f"{where}: scores", np.float64
        )
        problems += score_problems(values["scores"], ids)
    if answer is not None:
        found = np.asarray(answer)
        if found.shape != (count,) or found.dtype.kind not in "iu":
            raise PredictionError(
                f"{where}: answer: found {found.dtype} of shape {found.shape}, expected integers of"
                f" shape ({count},), {ABSTAINED} to {CANDIDATES - 1}"
            )
        values["answer"] = found
        problems += answer_problems(found, ids)
    if not values:
        raise PredictionError(f"{where}: found neither answer nor scores, expected either")
    if len(values) == 2 and not problems:
        from_scores = answers_from_scores(values["scores"])
        problems = agreement_problems(values["answer"].astype(np.int64), from_scores, ids)
    if problems:
        raise PredictionError(f"{where}: {and_more([str(problem) for problem in problems])}")
    return values


def _questions(path: str | Path) -> tuple[int, str]:
    """Return how many questions a file holds, images or not, and its fingerprint, if any."""
    from iqtt.files.reader import AnswersFile, QuestionsFile
    from iqtt.files.tables import NoImagesError

    try:
        with QuestionsFile(path) as questions:
            return len(questions), questions.fingerprint or ""
    except NoImagesError:
        with AnswersFile(path) as answers:
            return len(answers), answers.fingerprint or ""

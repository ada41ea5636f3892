"""Questions of a report: some that were answered rightly, and some that were not, with pictures."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import ABSTAINED
from metrics.report.pictures import data_url
from metrics.report.scenes import SHOWN, Pictured
from metrics.scoring.records import ScoreFile
from metrics.submissions.reader import QuestionPredictions, open_predictions
from scenegen.common.errors import SceneGenError
from scenegen.rooms.preview import srgb_bytes

LETTERS = "ABC"
ANSWERS_ENDING = "-answers"  # of the name of the file of answers, beside that of the questions


def questions_beside(truth: Path) -> Path | None:
    """Return the file that holds the pictures of the questions whose answers are in `truth`.

    That is the truth itself, or the file beside it with the same name without "-answers"; None
    where neither lies there.
    """
    beside = truth.with_name(truth.stem.removesuffix(ANSWERS_ENDING) + truth.suffix)
    return next((path for path in (beside, truth) if os.path.isfile(path)), None)


def chosen_questions(right: NDArray[np.bool_], most: int = SHOWN) -> dict[str, list[int]]:
    """Return entries to show by "right" and "wrong", evenly spread over the file's order."""
    found = {}
    for title, entries in (("right", np.flatnonzero(right)), ("wrong", np.flatnonzero(~right))):
        spread = np.linspace(0, len(entries) - 1, min(most, len(entries)))
        if len(entries):
            found[title] = entries[np.rint(spread).astype(int)].tolist()
    return found


def pictured_questions(
    scores: ScoreFile, truth: Path, submission: Path
) -> list[tuple[str, list[Pictured]]]:
    """Return questions that the first run answers rightly and wrongly, with titles and pictures.

    Nothing is returned where no file beside the truth holds the pictures, or where the one of that
    name is of another split. Raises OSError and FileFormatError where a file cannot be read.
    """
    from iqtt.files.reader import QuestionsFile

    images = questions_beside(truth)
    if images is None or not _has_images(images):
        return []
    joined = None if images.samefile(truth) else truth
    try:
        questions = QuestionsFile(images, answers=joined)
    except SceneGenError:
        if joined is None:
            raise
        return []
    with questions, open_predictions(submission) as given:
        assert isinstance(given, QuestionPredictions)
        place = dict(zip(given.rows.tolist(), given.answers.tolist(), strict=True))
        ids = scores.ids.tolist()
        answers = np.array([place.get(i, ABSTAINED) for i in ids])
        true = np.asarray(questions.read("answers", slice(None)), np.int64)[scores.ids]
        right = answers == true
        totals = {"right": int(right.sum()), "wrong": int((~right).sum())}
        return [
            (
                f"{len(entries)} of {totals[title]:,} questions answered {title}ly",
                [_pictured(questions[ids[i]], int(true[i]), int(answers[i])) for i in entries],
            )
            for title, entries in chosen_questions(right).items()
        ]


def _has_images(path: Path) -> bool:
    """Return whether a file holds questions, as a file of answers alone does not."""
    import h5py

    from scenegen.files import trial

    trial.try_file(path)
    with h5py.File(path, "r") as file:
        return isinstance(file.get("questions"), h5py.Dataset)


def _pictured(record: Any, right: int, given: int) -> Pictured:
    """The pictures of a question, with what is right and what was answered below each answer."""
    pictures = [data_url(srgb_bytes(np.nan_to_num(image))) for image in record.radiance]
    answers = range(len(pictures) - 1)
    captions = ["reference", *(f"answer {LETTERS[k]}" for k in answers)]
    marks = ["", *(_mark(k == right, k == given) for k in answers)]
    told = f"right is {LETTERS[right]}, "
    told += "no answer was given" if given == ABSTAINED else f"{LETTERS[given]} was answered"
    kinds: Sequence[str | None] = record.truth.distractor_kind if record.truth else ()
    wrong = sorted({kind for kind in kinds if kind})
    told += f"; wrong answers: {', '.join(wrong)}" if wrong else ""
    paired = list(zip(captions, pictures, strict=True))
    return Pictured(f"question {record.index}", told, paired, marks)


def _mark(is_right: bool, is_given: bool) -> str:
    if is_right and is_given:
        return "right, answered"
    return "right" if is_right else "answered" if is_given else ""

"""`score` turns submissions into scores with intervals: start reading here."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from metrics.scoring.questions import score_questions
from metrics.scoring.records import ScoreFile
from metrics.scoring.rooms import score_rooms
from metrics.scoring.runs import Progress, ScoringError, Settings
from metrics.submissions.reader import (
    QuestionPredictions,
    RoomPredictions,
    open_predictions,
)
from metrics.submissions.truths import find_truth


def score(
    paths: Sequence[str | Path],
    truth: str | Path | None = None,
    settings: Settings | None = None,
    progress: Progress = lambda done: None,
) -> ScoreFile:
    """Score one submission, or several runs of one method, against the truth.

    Views are averaged within a scene, then scenes; several runs are averaged within each item, and
    `std` is the standard deviation over runs (with n - 1). Intervals resample whole scenes; those
    of IQTT accuracy are Wilson's for a single run, and resample for several, both over shapes.

    Args:
        paths: submissions of one method, task and alignment.
        truth: where the truth lies. Without it the first submission says so, and scores are not
            comparable unless the truth is one of `known_tests`.
        settings: None for the defaults.
        progress: called with the number of rows that were scored since it was last called.

    Raises:
        OSError: a file that is not there.
        FileFormatError: a file that is none of ours, or broken, or that changes meanwhile.
        ScoringError: the wrong truth, or a changed one; rows that are missing or unknown; values
            that are not finite; two copies of one run.
    """
    settings = settings or Settings()
    with ExitStack() as stack:
        files = []
        for path in paths:
            files.append(open_predictions(path))
            stack.callback(files[-1].close)
        _check_alike(files)
        found = find_truth(files[0], truth)
        rooms = [file for file in files if isinstance(file, RoomPredictions)]
        if rooms:
            scores = score_rooms(rooms, found, settings, progress)
        else:
            answers = [file for file in files if isinstance(file, QuestionPredictions)]
            scores = score_questions(answers, found, settings, progress)
        for file in files:
            file.require_unchanged()
        return scores


def count_rows(path: str | Path) -> int:
    """Return how many rows a submission answers. Raises as `open_predictions`."""
    with open_predictions(path) as predictions:
        return len(predictions)


def _check_alike(files: Sequence[RoomPredictions | QuestionPredictions]) -> None:
    """Raise ScoringError unless the files are runs of one method on one task."""
    first = files[0]
    seen: dict[str, Path] = {}
    for file in files:
        for name in ("task", "method", "alignment"):
            ours, theirs = (getattr(one, name, None) for one in (first, file))
            if ours != theirs:
                raise ScoringError(
                    f"{file.path}: {name}",
                    repr(theirs),
                    f"{ours!r} as in {first.path}",
                    "only runs of one method are averaged; score others by themselves, then"
                    " `bench compare`",
                )
        if file.sha256 in seen:
            raise ScoringError(
                file.path, f"the same bytes as in {seen[file.sha256]}", "each submission once"
            )
        seen[file.sha256] = file.path

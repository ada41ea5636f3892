"""`score` turns submissions into scores with intervals: start reading here."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TypeVar

from metrics.measured.protocols import ProtocolError
from metrics.measured.reader import MeasuredFile, open_images
from metrics.measures.alignment import Alignment
from metrics.scoring.images.geometry import alignments_scored
from metrics.scoring.questions import score_questions
from metrics.scoring.records import ScoreFile
from metrics.scoring.rooms import score_measured, score_rooms
from metrics.scoring.runs import (
    MeasuredRuns,
    Progress,
    QuestionRuns,
    RoomRuns,
    Runs,
    ScoringError,
    Settings,
)
from metrics.submissions.reader import (
    Predictions,
    QuestionPredictions,
    RoomPredictions,
    open_predictions,
)
from metrics.submissions.truths import find_truth

Result = TypeVar("Result")


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
    with open_runs(paths, truth) as runs:
        return score_runs(runs, settings or Settings(), progress)


@contextmanager
def open_runs(paths: Sequence[str | Path], truth: str | Path | None = None) -> Iterator[Runs]:
    """Open and check submissions and their truth for `score_runs`. Raises as `score`."""
    with ExitStack() as opening:
        files = []
        for path in paths:
            files.append(open_predictions(path))
            opening.enter_context(files[-1])
        _check_alike(files)
        place = find_truth(files[0], truth)
        runs = _runs(files, place.path, place.source == "given")
        opening.callback(runs.truth.close)
        yield runs


def _runs(files: Sequence[Predictions], truth: Path, given: bool) -> Runs:
    """Return submissions of one task with their truth, which is opened here."""
    answers = [file for file in files if isinstance(file, QuestionPredictions)]
    if answers:
        from iqtt.files.reader import AnswersFile

        return QuestionRuns(answers, AnswersFile(truth), given)
    images, opened = (
        [file for file in files if isinstance(file, RoomPredictions)],
        open_images(truth),
    )
    if isinstance(opened, MeasuredFile):
        return MeasuredRuns(images, opened, given)
    return RoomRuns(images, opened, given)


def score_runs(runs: Runs, settings: Settings, progress: Progress) -> ScoreFile:
    """Score open submissions. Raises as `score`, and ProtocolError."""
    _align(runs.files, settings.align)
    if settings.protocol or isinstance(runs, MeasuredRuns):
        (scores,) = score_measured(_measured(runs), settings, progress)
    elif isinstance(runs, RoomRuns):
        scores = score_rooms(runs, settings, progress)
    else:
        assert isinstance(runs, QuestionRuns), "there are no others"
        scores = score_questions(runs, settings, progress)
    return _unchanged(runs, scores)


def score_protocols(runs: Runs, settings: Settings, progress: Progress) -> list[ScoreFile]:
    """Score open submissions under all protocols that suit them. Raises as `score_runs`."""
    _align(runs.files, settings.align)
    return _unchanged(runs, score_measured(_measured(runs), settings, progress, all_protocols=True))


def allowed_alignments(file: RoomPredictions) -> set[Alignment]:
    """Return the alignments a submission can be scored under: its own one, and looser ones."""
    if file.kind == "disparity":
        return {"disparity_scale_shift"}
    allowed = {file.alignment, *alignments_scored(file.kind, file.alignment)}
    by_least_squares = {file.alignment, "scale", "scale_shift"}
    return allowed & by_least_squares if file.kind in ("points", "layers") else allowed


def _align(files: Sequence[Predictions], alignment: Alignment | None) -> None:
    """Score files under an alignment that is as loose as theirs. Raises ScoringError for others."""
    for file in files if alignment is not None else ():
        if not isinstance(file, RoomPredictions):
            raise ScoringError(
                file.path, f"responses to questions, with --align {alignment}", "depth or points"
            )
        allowed = allowed_alignments(file)
        if alignment not in allowed:
            found = f"{file.kind} under {file.alignment}, scored under {alignment}"
            raise ScoringError(file.path, found, f"one of {', '.join(sorted(allowed))}")
        file.scored_as = alignment if file.kind != "disparity" else None


def _unchanged(runs: Runs, scores: Result) -> Result:
    """Return scores of files that are still those that were opened. Raises FileFormatError."""
    for file in runs.files:
        file.require_unchanged()
    return scores


def _measured(runs: Runs) -> MeasuredRuns:
    """Raise ProtocolError for truth that is exact, and has no pixels or ranges to choose."""
    if not isinstance(runs, MeasuredRuns):
        expected = "measured ground truth, as `bench truth` makes it"
        raise ProtocolError("protocol", f"one for {runs.truth.path}", expected)
    return runs


def _check_alike(files: Sequence[Predictions]) -> None:
    """Raise ScoringError unless the files are runs of one method on one task."""
    first = files[0]
    seen: dict[str, Path] = {}
    for file in files:
        for name in ("task", "method", "alignment", "shown"):
            ours, theirs = getattr(first, name), getattr(file, name)
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

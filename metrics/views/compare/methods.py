"""Score files and submissions side by side: submissions are scored before they are compared."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path

from metrics.measures.alignment import Alignment
from metrics.score_file import read_scores
from metrics.scoring.aligned import common_alignment
from metrics.scoring.evaluate import allowed_alignments, open_runs, score_runs
from metrics.scoring.images.geometry import scored_alignment
from metrics.scoring.records import ScoreFile
from metrics.scoring.runs import Progress, Runs, Settings
from metrics.scoring.truth_digests import stated_truth
from metrics.submissions.reader import RoomPredictions
from scenegen.files.trial import is_hdf5


def read_or_score(
    paths: Sequence[str | Path],
    truth: str | Path | None,
    settings: Settings,
    progress_of: Callable[[int], AbstractContextManager[Progress]],
) -> list[ScoreFile]:
    """Return the scores of each path: a score file, or a submission, which is scored here.

    A submission is scored under the alignment that is common to all methods on its ground truth, if
    it can be, so that no metric is missing after it.

    Args:
        truth: ground truth of the submissions; without it each submission names its own.
        settings: `align` is the alignment to compare under; None for the loosest declared one.
        progress_of: called with the number of rows to score; gives the callback of `score`.

    Raises:
        As `read_scores`, `score` and `common_alignment`.
    """
    with ExitStack() as opening:
        opened: list[Runs | ScoreFile] = []
        for path in paths:
            submitted = is_hdf5(path)
            opened.append(
                opening.enter_context(open_runs([path], truth)) if submitted else read_scores(path)
            )
        rows = sum(len(one.files[0]) for one in opened if isinstance(one, Runs))
        progress = opening.enter_context(progress_of(rows)) if rows else None
        scored: list[ScoreFile] = []
        for path, one in zip(paths, opened, strict=True):
            if isinstance(one, ScoreFile):
                scored.append(one)
            elif progress is not None:
                rivals = [_declared(other) for other in opened if _truth(other) == _truth(one)]
                common = common_alignment(rivals, settings.align)
                scored.append(_scored(one, Path(path), common, settings, progress))
        return scored


def _truth(one: Runs | ScoreFile) -> tuple[str, str | None]:
    return one.truth if isinstance(one, ScoreFile) else stated_truth(one.truth)


def _declared(one: Runs | ScoreFile) -> tuple[str, Alignment]:
    if isinstance(one, ScoreFile):
        return one.method, one.alignment
    file = one.files[0]
    images = isinstance(file, RoomPredictions)
    return file.method, scored_alignment(file.kind, file.alignment) if images else "none"


def _scored(
    runs: Runs, path: Path, common: Alignment, settings: Settings, progress: Progress
) -> ScoreFile:
    (_, declared), file = _declared(runs), runs.files[0]
    can = isinstance(file, RoomPredictions) and common in allowed_alignments(file)
    scores = score_runs(runs, replace(settings, align=common if can else None), progress)
    return replace(scores, path=path, declared=None if declared == scores.alignment else declared)

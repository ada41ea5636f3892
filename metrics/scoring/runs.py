"""What scoring rooms and scoring questions share: settings, rows that match, what is recorded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from metrics.measures.statistics import RESAMPLES
from metrics.scoring.item_scores import NonFinite
from metrics.scoring.records import Meta, Submission
from metrics.scoring.room_rows import ScoringError
from metrics.submissions.missing_rows import match_problems
from metrics.submissions.problems import Problem
from metrics.submissions.reader import QuestionPredictions, RoomPredictions
from scenegen.common.row_file import and_more, writer_name

Array = NDArray[Any]
Progress = Callable[[int], Any]
Kind = TypeVar("Kind", RoomPredictions, QuestionPredictions)
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Settings:
    """How to score.

    Attributes:
        seed, resamples: of the bootstrap.
        allow_partial: score the rows that are there; the result is not comparable.
        non_finite: "error", or "penalise" (see `item_scores.score_view`); if that was needed, the
            result is not comparable.
        processes: for rooms; None for as many as there are cores. Changes no number.
    """

    seed: int = 0
    resamples: int = RESAMPLES
    allow_partial: bool = False
    non_finite: NonFinite = "error"
    processes: int | None = None


def matched_rows(
    files: Sequence[Kind], truth_path: Path, fingerprint: str | None, count: int, partial: bool
) -> tuple[Array, bool]:
    """Return the rows of the truth that all files answer, and whether those are all rows.

    Raises ScoringError for another truth, unknown rows, and missing ones unless `partial`.
    """
    rows = np.arange(count)
    for file in files:
        problems = match_problems(file, truth_path, fingerprint, count)
        advice = ""
        if partial:
            problems = [problem for problem in problems if problem.rule != "complete"]
        elif any(problem.rule == "complete" for problem in problems):
            advice = "; to score the rest, not comparably, say --allow-partial"
        refuse(file.path, problems, advice)
        rows = np.intersect1d(rows, file.rows)
    if not rows.size:
        raise ScoringError(f"{files[0].path}: answers no row of {truth_path}")
    return rows, len(rows) == count


def refuse(path: Path, problems: Sequence[Problem], advice: str = "") -> None:
    """Raise ScoringError with the problems, if there are any."""
    if problems:
        raise ScoringError(f"{path}: {and_more([str(one) for one in problems])}{advice}")


def known(value: float) -> float | None:
    """Return the value for JSON: None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def warnings_of(whole: bool, scored: int, count: int, penalised: Sequence[int]) -> list[str]:
    """Say why the scores are not comparable, if they are not."""
    found = []
    if not whole:
        found.append(f"not comparable: only {scored} of {count} rows were answered by all runs")
    if penalised:
        found.append(f"not comparable: {len(penalised)} rows with values that are not finite")
    return found


def meta_of(
    files: Sequence[RoomPredictions | QuestionPredictions],
    truth_path: Path,
    fingerprint: str,
    settings: Settings,
    counts: dict[str, int],
    warnings: list[str],
    floor: float | None,
) -> Meta:
    """Return what a score file records beside its numbers."""
    resampled = files[0].task == "rooms" or len(files) > 1
    return Meta(
        truth_fingerprint=fingerprint,
        truth_path=str(truth_path),
        submissions=tuple(Submission(str(file.path), file.sha256, file.run) for file in files),
        writer=writer_name(),
        versions={"numpy": np.__version__},
        seed=settings.seed,
        resamples=settings.resamples if resampled else 0,
        confidence=CONFIDENCE,
        counts=counts,
        warnings=tuple(warnings),
        chamfer_floor=floor,
    )

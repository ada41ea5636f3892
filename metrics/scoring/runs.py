"""What scoring rooms and scoring questions share: settings, rows to score, what is recorded."""

import importlib.metadata
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.statistics import RESAMPLES
from metrics.scoring.image_scores import NonFinite
from metrics.scoring.known_tests import known_test
from metrics.scoring.records import Meta, Submission, TruthSource
from metrics.submissions.missing_rows import match_problems
from metrics.submissions.problems import Problem, first_error
from metrics.submissions.reader import Predictions
from metrics.submissions.truths import FoundTruth
from scenegen.common.errors import SceneGenError
from scenegen.files.cluster import Cluster
from scenegen.files.row_file import writer_name

Array = NDArray[Any]
Progress = Callable[[int], Any]
CONFIDENCE = 0.95
LIBRARIES = ("numpy", "pykdtree", "scipy")  # whose releases scores may depend on


class ScoringError(SceneGenError):
    """Predictions that cannot be scored against this truth."""


@dataclass(frozen=True)
class Settings:
    """How scores are computed.

    Attributes:
        seed, resamples: seed and number of samples of the bootstrap.
        allow_partial: score the rows that are there; the result is not comparable.
        non_finite: "error", or "penalise" (see `image_scores.score_view`); where a value had to be
            penalised, the result is not comparable.
        processes: how many processes score rooms; None for one a core. Changes no number.
        cluster: whose workers score rooms instead; they must see the files. Changes no number.
    """

    seed: int = 0
    resamples: int = RESAMPLES
    allow_partial: bool = False
    non_finite: NonFinite = "error"
    processes: int | None = None
    cluster: Cluster | None = None


def scorer_versions() -> dict[str, str]:
    """Return what scores depend on beside the files: the versions of this program and LIBRARIES."""
    return {"writer": writer_name(), **_releases()}


def _releases() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in LIBRARIES}


def matched_rows(
    files: Sequence[Predictions],
    truth_path: Path,
    fingerprint: str | None,
    count: int,
    partial: bool,
) -> tuple[Array, bool]:
    """Return the rows of the truth that all files answer, and whether those are all rows.

    Raises ScoringError for another truth, unknown rows, and missing ones unless `partial`.
    """
    rows = np.arange(count)
    for file in files:
        problems = match_problems(file, truth_path, fingerprint, count)
        if partial:
            problems = [problem for problem in problems if problem.rule != "complete"]
        refuse(file.path, problems)
        rows = np.intersect1d(rows, file.rows)
    if not rows.size:
        raise ScoringError(files[0].path, "no row that all runs answer", f"rows of {truth_path}")
    return rows, len(rows) == count


def refuse(path: Path, problems: Sequence[Problem]) -> None:
    """Raise ScoringError with the first of the problems, if there are any."""
    incomplete = any(problem.rule == "complete" for problem in problems)
    advice = "to score the rest, not comparably, say --allow-partial" if incomplete else ""
    if problems:
        raise first_error(ScoringError, path, problems, advice)


def known(value: float) -> float | None:
    """Return the value for JSON: None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def refuse_copies(files: Sequence[Predictions], same: Callable[[int, int], Any]) -> None:
    """Raise ScoringError where two submissions, told apart by `same`, are one training run."""
    for i, j in itertools.combinations(range(len(files)), 2):
        if same(i, j):
            found = f"the same predictions as in {files[i].path}"
            raise ScoringError(files[j].path, found, "each training run once")


def source_of(truth: FoundTruth, digest: str) -> TruthSource:
    """Return where the truth comes from."""
    if truth.source == "submission" and known_test(digest) is not None:
        return "known"
    return truth.source


def warnings_of(
    whole: bool, scored: int, count: int, penalised: Sequence[int], truth: FoundTruth, digest: str
) -> list[str]:
    """Return why the scores are not comparable, if they are not."""
    found = []
    if source_of(truth, digest) == "submission":
        found.append(
            f"not comparable: without --truth these scores are not ranked: {truth.path}, digest"
            f" {digest:.12}, was used because the submission names it; if it is the right file,"
            f" score again with --truth {truth.path}"
        )
    if not whole:
        found.append(f"not comparable: only {scored} of {count} rows were answered by all runs")
    if penalised:
        found.append(f"not comparable: {len(penalised)} rows with values that are not finite")
    return found


def meta_of(
    files: Sequence[Predictions],
    truth: FoundTruth,
    fingerprint: str,
    digest: str,
    settings: Settings,
    counts: dict[str, int],
    warnings: list[str],
    noise_floors: Mapping[str, float] | None = None,
) -> Meta:
    """Return what a score file records beside its numbers."""
    resampled = files[0].task == "rooms" or len(files) > 1
    return Meta(
        truth_fingerprint=fingerprint,
        truth_path=str(truth.path),
        truth_digest=digest,
        truth_source=source_of(truth, digest),
        submissions=tuple(Submission(str(file.path), file.sha256, file.run) for file in files),
        writer=writer_name(),
        versions=_releases(),
        seed=settings.seed,
        resamples=settings.resamples if resampled else 0,
        confidence=CONFIDENCE,
        counts=counts,
        warnings=tuple(warnings),
        noise_floors=noise_floors or {},
    )

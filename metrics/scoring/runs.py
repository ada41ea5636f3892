"""What scoring rooms and scoring questions share: settings, rows to score, what is recorded."""

import importlib.metadata
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from iqtt.floors import Floor
from metrics.measured.reader import Images, MeasuredFile
from metrics.measures.alignment import Alignment
from metrics.measures.statistics import RESAMPLES
from metrics.scoring.images.image_scores import NonFinite
from metrics.scoring.records import Meta, Submission
from metrics.submissions.problems import Problem, first_error
from metrics.submissions.reader import Predictions, QuestionPredictions, RoomPredictions
from metrics.submissions.truths import match_problems
from scenegen.common.errors import SceneGenError
from scenegen.files.row_file import writer_name
from scenegen.files.sets.cluster import Cluster
from scenegen.rooms.reader import RoomsFile

if TYPE_CHECKING:
    from iqtt.files.reader import AnswersFile

Array = NDArray[Any]
Progress = Callable[[int], Any]
LIBRARIES = ("numpy", "pykdtree", "scipy")  # whose releases scores may depend on


class ScoringError(SceneGenError):
    """Predictions that cannot be scored against this truth."""


@dataclass(frozen=True)
class Settings:
    """How scores are computed.

    Attributes:
        seed, resamples: seed and number of samples of the bootstrap.
        allow_partial: score the rows that are there; the result is not comparable.
        non_finite: "error", or "penalise" (see `image_scores.score_prediction`); where a value had
            to be penalised, the result is not comparable.
        processes: how many processes score rooms; None for one a core. Changes no number.
        cluster: whose workers score rooms instead; they must see the files. Changes no number.
        floors: a file of floors of questions, as `iqtt floors` writes it; None for those of the
            package.
        protocol: of measured truth, one of `metrics.measured.protocols`; "" for "declared".
        align: the alignment of images to score under, at least as loose as the declared one; None
            for that.
    """

    seed: int = 0
    resamples: int = RESAMPLES
    allow_partial: bool = False
    non_finite: NonFinite = "error"
    processes: int | None = None
    cluster: Cluster | None = None
    floors: str | Path | None = None
    protocol: str = ""
    align: Alignment | None = None


@dataclass(frozen=True, eq=False)
class Runs:
    """Open submissions, which are runs of one method on one task, and their open truth.

    Attributes:
        truth_given: whether the person who scores named the truth, and not the submission.
    """

    files: Sequence[Predictions]
    truth: "Images | AnswersFile"
    truth_given: bool


@dataclass(frozen=True, eq=False)
class RoomRuns(Runs):
    """Runs on rooms."""

    files: Sequence[RoomPredictions]
    truth: RoomsFile


@dataclass(frozen=True, eq=False)
class MeasuredRuns(Runs):
    """Runs on truth that others measured."""

    files: Sequence[RoomPredictions]
    truth: MeasuredFile


@dataclass(frozen=True, eq=False)
class QuestionRuns(Runs):
    """Runs on questions."""

    files: Sequence[QuestionPredictions]
    truth: "AnswersFile"


def scorer_versions() -> dict[str, str]:
    """Return what scores depend on beside the files: the versions of this program and LIBRARIES."""
    return {"writer": writer_name(), **_releases()}


def _releases() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in LIBRARIES}


def matched_rows(runs: Runs, partial: bool) -> Array:
    """Return the rows of the truth that all files answer, in ascending order.

    Raises ScoringError for another truth, unknown rows, and missing ones unless `partial`.
    """
    rows = np.arange(len(runs.truth))
    for file in runs.files:
        problems = match_problems(file, runs.truth)
        if partial:
            problems = [problem for problem in problems if problem.rule != "complete"]
        raise_first_problem(file.path, problems)
        rows = np.intersect1d(rows, file.rows)
    if not rows.size:
        expected = f"rows of {runs.truth.path}"
        raise ScoringError(runs.files[0].path, "no item that all runs predict", expected)
    return rows


def raise_first_problem(path: Path, problems: Sequence[Problem]) -> None:
    """Raise ScoringError with the first of the problems, if there are any."""
    incomplete = any(problem.rule == "complete" for problem in problems)
    advice = "use --allow-partial to score the rest, without a rank" if incomplete else ""
    if problems:
        raise first_error(ScoringError, path, problems, advice)


def refuse_copies(files: Sequence[Predictions], same: Callable[[int, int], Any]) -> None:
    """Raise ScoringError where two submissions, told apart by `same`, are one training run."""
    for i, j in itertools.combinations(range(len(files)), 2):
        if same(i, j):
            found = f"the same predictions as in {files[i].path}"
            raise ScoringError(files[j].path, found, "each training run once")


def meta_of(
    runs: Runs,
    fingerprint: str,
    digest: str,
    settings: Settings,
    counts: Mapping[str, int],
    question_floors: Sequence[Floor] = (),
) -> Meta:
    """Return what a score file records beside its items."""
    files, truth = runs.files, runs.truth
    resampled = files[0].task != "iqtt" or len(files) > 1
    return Meta(
        truth_fingerprint=fingerprint,
        truth_path=str(truth.path),
        truth_digest=digest,
        truth_given=runs.truth_given,
        submissions=tuple(Submission(str(file.path), file.sha256, file.run) for file in files),
        writer=writer_name(),
        versions=_releases(),
        seed=settings.seed,
        resamples=settings.resamples if resampled else 0,
        counts=counts,
        question_floors=tuple(question_floors),
    )

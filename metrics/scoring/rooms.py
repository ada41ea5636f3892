"""Scores of submissions that predict rooms: every row is scored, in one or more processes."""

import atexit
import functools
import os
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from metrics.measures.depth import Alignment
from metrics.measures.statistics import bootstrap_interval, cluster_means
from metrics.scoring.image_scores import ALIGNMENTS, chamfer_floor, score_view
from metrics.scoring.metric_names import metric
from metrics.scoring.records import Score, ScoreFile
from metrics.scoring.runs import (
    CONFIDENCE,
    Progress,
    ScoringError,
    Settings,
    known,
    matched_rows,
    meta_of,
    refuse,
    refuse_copies,
    warnings_of,
)
from metrics.scoring.truth_digests import RowDigests, rooms_digest, view_digests
from metrics.submissions.missing_rows import size_problems
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import Identity, RoomPredictions, open_predictions
from metrics.submissions.truths import FoundTruth, read_true_view
from scenegen.common.worker_pool import worker_pool
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
# What a process must know to score rows, small, as it is sent along with each chunk: the paths and
# identities of the submissions, the path of the truth, and the alignments of scored depth.
Job = tuple[tuple[tuple[Path, Identity], ...], Path, tuple[Alignment, ...]]
CHUNK = 8  # rows scored between two reports of progress
FEW = 32  # rows that are not worth starting processes for
FLOOR_ROWS = 16  # rows on which the noise floor is measured
IDS_SHOWN = 8


def score_rooms(
    files: Sequence[RoomPredictions], found: FoundTruth, settings: Settings, progress: Progress
) -> ScoreFile:
    """Score runs of one method on a rooms file; raises as `evaluate.score`."""
    with RoomsFile(found.path) as truth:
        count, fingerprint = len(truth), truth.fingerprint
        for file in files:
            refuse(file.path, size_problems(file, truth))
    rows, whole = matched_rows(files, found.path, fingerprint, count, settings.allow_partial)
    for file in files:
        if file.has_normals != files[0].has_normals:
            told, expected = ("normals", "none") if file.has_normals else ("none", "normals")
            raise ScoringError(f"{file.path}: normal", told, f"{expected} as in {files[0].path}")
    alignment = files[0].alignment
    scored = score_rows(files, found.path, rows, alignment, settings.processes, progress)
    scores, bad = scored.scores, scored.bad
    if bad and settings.non_finite == "error":
        first = next(iter(bad.values()))
        shown = ", ".join(map(str, list(bad)[:IDS_SHOWN])) + ", ..." * (len(bad) > IDS_SHOWN)
        told = f"rows that cannot be scored, {len(bad)} in all: {shown}"
        advice = "mend them, or score them at the worst with --non-finite penalise"
        raise ScoringError(first.where, first.found, first.expected, f"{told}; {advice}")
    refuse_copies(files, lambda i, j: all((each[i] == each[j]).all() for each in scores.values()))
    with RoomsFile(found.path) as truth:
        digest = rooms_digest(truth, scored.digests)
        scene = truth.read("scene_index", slice(None))
        view = truth.read("view_index", slice(None))
        angle = view_angles(scene, view, truth.read("camera/world_from_camera", slice(None)))[rows]
        scene, view = scene[rows], view[rows]
        some = rows[np.unique(np.linspace(0, len(rows) - 1, FLOOR_ROWS).astype(int))]
        floors = np.array([chamfer_floor(read_true_view(truth, int(row))) for row in some])
    floors = floors[np.isfinite(floors)]
    by_angle = {}
    if len(np.unique(view)) > 1:
        for degrees in np.unique(angle[angle >= 0]).tolist():
            some = angle == degrees
            of_angle = {name: runs[:, some] for name, runs in scores.items()}
            by_angle[str(degrees)] = _estimates(of_angle, scene[some], settings)
    warnings = warnings_of(whole, len(rows), count, list(bad), found, digest)
    items = {
        "row": rows,
        "scene_index": scene,
        "view_index": view,
        "view_angle_degrees": angle,
        **{name: runs.mean(axis=0) for name, runs in scores.items()},
    }
    counts = {
        "rows": len(rows),
        "rows_in_truth": count,
        "scenes": len(np.unique(scene)),
        "runs": len(files),
        "rows_penalised": len(bad),
    }
    noise_floors = {"chamfer": float(np.mean(floors))} if len(floors) else {}
    return ScoreFile(
        task="rooms",
        method=files[0].method,
        comparable=not warnings,
        alignment=alignment,
        metrics=_estimates(scores, scene, settings),
        by_view_angle=by_angle,
        items=items,
        meta=meta_of(files, found, fingerprint, digest, settings, counts, warnings, noise_floors),
    )


@dataclass
class ScoredRows:
    """Scores of M rows of R submissions, and what was found on the way.

    Attributes:
        scores: by name, (R, M).
        bad: for each row with values that are not finite, or normals of length 0, what is wrong;
            such values have the worst score.
        digests: of what was read of the truth, by row.
    """

    scores: dict[str, Array] = field(default_factory=dict)
    bad: dict[int, ScoringError] = field(default_factory=dict)
    digests: dict[int, RowDigests] = field(default_factory=dict)


def score_rows(
    files: Sequence[RoomPredictions],
    truth_path: Path,
    rows: Array,
    alignment: str,
    processes: int | None = None,
    progress: Progress = lambda done: None,
) -> ScoredRows:
    """Score these M rows in each of R submissions; the numbers do not depend on `processes`."""
    alignments = tuple(a for a in get_args(Alignment) if a in (*ALIGNMENTS, alignment))
    job = tuple((file.path, file.identity) for file in files), truth_path, alignments
    chunks = [rows[i : i + CHUNK] for i in range(0, len(rows), CHUNK)]
    table: list[list[dict[str, float]]] = []
    found = ScoredRows()
    for scored, bad, digests in _in_processes(job, chunks, processes):
        table += scored
        found.bad |= bad
        found.digests |= digests
        progress(len(scored))
    for name in table[0][0]:
        found.scores[name] = np.array([[run[name] for run in row] for row in table]).T
    return found


def view_angles(scene_index: Array, view_index: Array, world_from_camera: Array) -> Array:
    """Return by how much each view is turned from its scene's first one, (N,) whole degrees.

    About the vertical axis, from 0 to 180; -1 where the scene's first view is not in the file.
    `scene_index` and `view_index` are (N,), `world_from_camera` is (N, 4, 4).
    """
    back = world_from_camera[:, :3, 2]
    azimuth = np.degrees(np.arctan2(back[:, 0], back[:, 2]))
    first = {int(scene_index[i]): azimuth[i] for i in np.flatnonzero(view_index == 0)}
    from_first = np.array([first.get(int(scene), np.nan) for scene in scene_index])
    turned = np.abs((azimuth - from_first + 180.0) % 360.0 - 180.0)
    return np.where(np.isfinite(turned), np.rint(turned), -1).astype(np.int64)


class _RowScorer:
    """The files of a job, open in one process, and where each row lies in each submission."""

    def __init__(
        self,
        submissions: tuple[tuple[Path, Identity], ...],
        truth_path: Path,
        alignments: tuple[Alignment, ...],
    ) -> None:
        self._alignments = alignments
        with ExitStack() as opening:  # closes what is open already where a later file is refused
            self._truth = opening.enter_context(RoomsFile(truth_path))
            self._files = [
                opening.enter_context(open_predictions(path, tried=identity))
                for path, identity in submissions
            ]
            self._stack = opening.pop_all()
        self._entries = [{row: i for i, row in enumerate(f.rows.tolist())} for f in self._files]

    def close(self) -> None:
        """Close the files."""
        self._stack.close()

    def score(
        self, rows: Array
    ) -> tuple[list[list[dict[str, float]]], dict[int, ScoringError], dict[int, RowDigests]]:
        """Return for each row, for each file its scores; what is not finite, and digests, by row.

        Values that are not finite are penalised; the caller decides whether that shall count.
        """
        table, bad, digests = [], {}, {}
        for row in rows.tolist():
            view = read_true_view(self._truth, row)
            digests[row] = view_digests(view)
            line = []
            for file, entries in zip(self._files, self._entries, strict=True):
                assert isinstance(file, RoomPredictions)
                i = entries[row]
                depth, normal = file.depth(i), file.normal(i) if file.has_normals else None
                score = functools.partial(
                    score_view, depth, normal, view, alignments=self._alignments
                )
                try:
                    scores = score()
                except PredictionError as error:
                    where = f"{file.path}: row {row}: {error.where}"
                    bad[row] = ScoringError(where, error.found, error.expected, error.hint)
                    scores = score(non_finite="penalise")
                line.append(scores)
            table.append(line)
        return table, bad, digests


def _in_processes(job: Job, chunks: Sequence[Array], processes: int | None) -> Iterator[Any]:
    """Yield what `_RowScorer.score` gives for the chunks, in their order."""
    count = min(processes or os.cpu_count() or 1, len(chunks))
    if count == 1 or (processes is None and len(chunks) * CHUNK <= FEW):
        with closing(_RowScorer(*job)) as scorer:
            yield from map(scorer.score, chunks)
        return
    try:
        with worker_pool(count) as pool:
            yield from pool.map(functools.partial(_score_in_worker, job), chunks)
    except BrokenProcessPool as error:
        hint = "memory may be short: take fewer --processes"
        raise ScoringError(job[0][0][0], "a process that scores was killed", "", hint) from error


def _score_in_worker(job: Job, rows: Array) -> Any:
    return _scorer_of_this_process(job).score(rows)


@functools.cache
def _scorer_of_this_process(job: Job) -> _RowScorer:
    """Open the files of a job when its first chunk comes; a worker process has only one job."""
    scorer = _RowScorer(*job)
    atexit.register(scorer.close)
    return scorer


def _estimates(scores: dict[str, Array], scene: Array, settings: Settings) -> dict[str, Score]:
    """Return the mean of every score (R, M): views are averaged within scenes (M,), then scenes."""
    runs = np.stack(list(scores.values()), axis=-1)  # (R, M, K)
    means = cluster_means(runs.mean(axis=0), scene)
    low, high = bootstrap_interval(means, settings.seed, settings.resamples, CONFIDENCE)
    value = means.mean(axis=0)
    each = np.stack([cluster_means(run, scene).mean(axis=0) for run in runs])
    return {
        name: Score(
            float(value[k]),
            known(low[k]),
            known(high[k]),
            metric(name).unit,
            len(means),
            float(each[:, k].std(ddof=1)) if len(each) > 1 else None,
        )
        for k, name in enumerate(scores)
    }

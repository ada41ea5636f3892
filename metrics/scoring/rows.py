"""Rows of rooms, each scored in every submission, in one or more processes."""

import atexit
import functools
import os
from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from metrics.measures.depth import Alignment
from metrics.scoring.image_scores import (
    ALIGNMENTS,
    ImageScores,
    score_empty_room,
    score_view,
    true_relief,
)
from metrics.scoring.metric_names import OBJECT_SCORES
from metrics.scoring.runs import Progress, ScoringError, Settings
from metrics.scoring.truth_digests import RowDigests, view_digests
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import Identity, RoomPredictions, on_any_machine, open_predictions
from metrics.submissions.truths import read_true_view
from scenegen.files.cluster import Cluster
from scenegen.files.workers import worker_pool
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
# What a process must know to score rows, small, as it is sent along with each chunk: the paths and
# identities of the submissions, the path of the truth, and the alignments of scored depth.
Job = tuple[tuple[tuple[Path, Identity], ...], Path, tuple[Alignment, ...]]
CHUNK = 8  # rows scored between two reports of progress
CHUNKS = 8  # of them that a worker of a cluster scores in one go
FEW = 32  # rows that are not worth starting processes for


@dataclass
class ScoredRows:
    """Scores of M rows of R submissions, and what was found on the way.

    Attributes:
        scores: by name, (R, M).
        floors: scores of the empty room, by name, (M,).
        objects: of each of L objects that count in these rows: `row`, `object` and `pixels`, (L,),
            and its scores by name, (R, L).
        bad: for each row with values that are not finite, or normals of length 0, what is wrong;
            such values have the worst score.
        digests: of what was read of the truth, by row.
    """

    scores: dict[str, Array] = field(default_factory=dict)
    floors: dict[str, Array] = field(default_factory=dict)
    objects: dict[str, Array] = field(default_factory=dict)
    bad: dict[int, ScoringError] = field(default_factory=dict)
    digests: dict[int, RowDigests] = field(default_factory=dict)


class _ScoredRow(NamedTuple):
    """One row: its scores in each submission, those of the empty room, what is not finite."""

    runs: list[ImageScores]
    floors: dict[str, float]
    bad: ScoringError | None
    digests: RowDigests


def score_rows(
    files: Sequence[RoomPredictions],
    truth_path: Path,
    rows: Array,
    alignment: str,
    settings: Settings,
    progress: Progress = lambda done: None,
) -> ScoredRows:
    """Score these M rows in each of R submissions, by the processes or cluster of the settings."""
    alignments = tuple(a for a in get_args(Alignment) if a in (*ALIGNMENTS, alignment))
    submissions = tuple((file.path.absolute(), file.identity) for file in files)
    job = submissions, truth_path.absolute(), alignments
    with RoomsFile(truth_path) as truth:
        scene, view = (
            truth.read(name, slice(None))[rows] for name in ("scene_index", "view_index")
        )
    pairs = np.stack([rows, rows[other_scenes(scene, view)]], axis=-1)
    chunks = [pairs[i : i + CHUNK] for i in range(0, len(rows), CHUNK)]
    found, parts, done = ScoredRows(), list[dict[str, Array]](), 0
    # Each chunk goes into arrays as it comes: as objects, 140,000 rows take 2 GB.
    if settings.cluster is None:
        found_chunks = _in_processes(job, chunks, settings.processes)
    else:
        found_chunks = _on_cluster(job, chunks, settings.cluster)
    for scored in found_chunks:
        here, first = slice(done, done + len(scored)), scored[0]
        done += len(scored)
        numbers = rows[here]
        for n, row in zip(numbers.tolist(), scored, strict=True):
            found.digests[n] = row.digests
            if row.bad is not None:
                found.bad[n] = row.bad
        for name in first.runs[0].scores:
            column = _column(found.scores, name, (len(files), len(rows)))
            column[:, here] = np.array([[run.scores[name] for run in row.runs] for row in scored]).T
        for name in first.floors:
            _column(found.floors, name, (len(rows),))[here] = [row.floors[name] for row in scored]
        counts = [len(row.runs[0].objects["object"]) for row in scored]
        parts.append({"row": np.repeat(numbers, counts)})
        for name in first.runs[0].objects:
            columns = [
                np.concatenate([row.runs[run].objects[name] for row in scored])
                for run in range(len(files))
            ]
            parts[-1][name] = np.stack(columns) if name in OBJECT_SCORES else columns[0]
        progress(len(scored))
    for name in parts[0]:
        found.objects[name] = np.concatenate([part[name] for part in parts], axis=-1)
    return found


def _column(columns: dict[str, Array], name: str, shape: tuple[int, ...]) -> Array:
    """Return a column of scores, which is added where it is new."""
    if name not in columns:
        columns[name] = np.full(shape, np.nan)
    return columns[name]


def other_scenes(scene_index: Array, view_index: Array) -> Array:
    """Return for each of N rows, (N,) each, one of another scene, as indices (N,).

    It is the next scene's in the same view; each row is that of exactly one other. So a prediction
    that is the same for all rows scores the same with these as with its own, on average. Each row
    is its own where there is one scene only, or views are so uneven that this pairs a scene with
    itself.
    """
    order = np.lexsort((scene_index, view_index))
    found = np.empty_like(order)
    found[order] = np.roll(order, -1)
    same = scene_index[found] == scene_index
    return np.arange(len(found)) if same.any() else found


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

    def score(self, pairs: Array) -> list[_ScoredRow]:
        """Return what is found in each of these rows, (N, 2) with a row of another scene each.

        Values that are not finite are penalised; the caller decides whether that shall count.
        """
        return [self._score_row(row, other) for row, other in pairs.tolist()]

    def _score_row(self, row: int, other: int) -> _ScoredRow:
        view = read_true_view(self._truth, row)
        read = functools.partial(self._truth.read, rows=other)
        names = ("depth", "camera/world_from_camera", "camera/fov_y_degrees")
        relief = true_relief(*map(read, names)) if other != row else None
        empty, bad, runs = score_empty_room(view), None, []
        for file, entries in zip(self._files, self._entries, strict=True):
            assert isinstance(file, RoomPredictions)
            i = entries[row]
            depth, normal = file.depth(i), file.normal(i) if file.has_normals else None
            known = depth, normal, view, empty.depth, relief
            score = functools.partial(score_view, *known, alignments=self._alignments)
            try:
                runs.append(score())
            except PredictionError as error:
                where = f"{file.path}: row {row}: {error.where}"
                bad = ScoringError(where, error.found, error.expected, error.hint)
                runs.append(score(non_finite="penalise"))
        return _ScoredRow(runs, empty.scores, bad, view_digests(view))


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


def _on_cluster(job: Job, chunks: Sequence[Array], cluster: Cluster) -> Iterator[Any]:
    """Yield what `_RowScorer.score` gives for the chunks, in their order."""
    submissions = tuple((path, on_any_machine(identity)) for path, identity in job[0])
    job = submissions, *job[1:]
    tasks = [chunks[i : i + CHUNKS] for i in range(0, len(chunks), CHUNKS)]
    for scored in cluster.in_order(functools.partial(_score_apart, job), tasks):
        yield from scored


def _score_apart(job: Job, chunks: Sequence[Array]) -> list[Any]:
    """Score chunks with files that are opened for them alone; a cluster's worker lives on."""
    with closing(_RowScorer(*job)) as scorer:
        return [scorer.score(chunk) for chunk in chunks]


def _score_in_worker(job: Job, rows: Array) -> Any:
    return _scorer_of_this_process(job).score(rows)


@functools.cache
def _scorer_of_this_process(job: Job) -> _RowScorer:
    """Open the files of a job when its first chunk comes; a worker process has only one job."""
    scorer = _RowScorer(*job)
    atexit.register(scorer.close)
    return scorer

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
from metrics.scoring.image_scores import ALIGNMENTS, ImageScores, score_empty_room, score_view
from metrics.scoring.metric_names import OBJECT_SCORES
from metrics.scoring.runs import Progress, ScoringError
from metrics.scoring.truth_digests import RowDigests, view_digests
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import Identity, RoomPredictions, open_predictions
from metrics.submissions.truths import read_true_view
from scenegen.common.worker_pool import worker_pool
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
# What a process must know to score rows, small, as it is sent along with each chunk: the paths and
# identities of the submissions, the path of the truth, and the alignments of scored depth.
Job = tuple[tuple[tuple[Path, Identity], ...], Path, tuple[Alignment, ...]]
CHUNK = 8  # rows scored between two reports of progress
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
    processes: int | None = None,
    progress: Progress = lambda done: None,
) -> ScoredRows:
    """Score these M rows in each of R submissions; the numbers do not depend on `processes`."""
    alignments = tuple(a for a in get_args(Alignment) if a in (*ALIGNMENTS, alignment))
    job = tuple((file.path, file.identity) for file in files), truth_path, alignments
    chunks = [rows[i : i + CHUNK] for i in range(0, len(rows), CHUNK)]
    table: list[_ScoredRow] = []
    for scored in _in_processes(job, chunks, processes):
        table += scored
        progress(len(scored))
    numbers, first = rows.tolist(), table[0]
    found = ScoredRows(
        bad={n: row.bad for n, row in zip(numbers, table, strict=True) if row.bad is not None},
        digests={n: row.digests for n, row in zip(numbers, table, strict=True)},
    )
    for name in first.runs[0].scores:
        found.scores[name] = np.array([[run.scores[name] for run in row.runs] for row in table]).T
    for name in first.floors:
        found.floors[name] = np.array([row.floors[name] for row in table])
    counts = [len(row.runs[0].objects["object"]) for row in table]
    found.objects["row"] = np.repeat(rows, counts)
    for name in first.runs[0].objects:
        columns = [
            np.concatenate([row.runs[run].objects[name] for row in table])
            for run in range(len(files))
        ]
        found.objects[name] = np.stack(columns) if name in OBJECT_SCORES else columns[0]
    return found


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

    def score(self, rows: Array) -> list[_ScoredRow]:
        """Return what is found in each of these rows.

        Values that are not finite are penalised; the caller decides whether that shall count.
        """
        return [self._score_row(row) for row in rows.tolist()]

    def _score_row(self, row: int) -> _ScoredRow:
        view = read_true_view(self._truth, row)
        empty, bad, runs = score_empty_room(view), None, []
        for file, entries in zip(self._files, self._entries, strict=True):
            assert isinstance(file, RoomPredictions)
            i = entries[row]
            depth, normal = file.depth(i), file.normal(i) if file.has_normals else None
            score = functools.partial(
                score_view, depth, normal, view, empty.depth, alignments=self._alignments
            )
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


def _score_in_worker(job: Job, rows: Array) -> Any:
    return _scorer_of_this_process(job).score(rows)


@functools.cache
def _scorer_of_this_process(job: Job) -> _RowScorer:
    """Open the files of a job when its first chunk comes; a worker process has only one job."""
    scorer = _RowScorer(*job)
    atexit.register(scorer.close)
    return scorer

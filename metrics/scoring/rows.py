"""Rows of rooms, each scored in every submission, in one or more processes."""

import atexit
import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.protocols import BY_NAME, ProtocolError
from metrics.measured.reader import Images, MeasuredFile, open_images
from metrics.measures.alignment import Alignment
from metrics.measures.confidence import distance_from_edges
from metrics.scoring.image_scores import (
    FirstView,
    ImageScores,
    reference_of,
    score_prediction,
    true_relief,
)
from metrics.scoring.kept_baselines import KeptBaselines, key_of
from metrics.scoring.layers import read_true_layers, score_layers, worst_of_layers
from metrics.scoring.measured_rows import scores_of_view
from metrics.scoring.metric_names import OBJECT_SCORES, OTHER_SCENE
from metrics.scoring.panoramas import baselines_of, score_panorama
from metrics.scoring.records import OBJECT_COLUMNS
from metrics.scoring.runs import Progress, ScoringError, Settings
from metrics.scoring.truth_digests import RowDigests, view_digests
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import Identity, RoomPredictions, on_any_machine, open_predictions
from metrics.submissions.truths import TrueView, read_true_view
from scenegen.common.cgroup import processors
from scenegen.common.threads import one_thread
from scenegen.files.pool import LostWorkerError
from scenegen.files.sets.cluster import Cluster
from scenegen.files.sets.workers import in_processes
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
# What another process must know to score rows, small, as it is sent along with each chunk: the
# paths and identities of the submissions, the path of the truth, the names of protocols, for truth
# that was measured, and the alignment that takes the place of the declared one.
Job = tuple[tuple[tuple[Path, Identity], ...], Path, tuple[str, ...], Alignment | None]
CHUNK = 8  # rows scored between two reports of progress
CHUNKS = 8  # of them that a worker of a cluster scores in one go
FEW = 32  # rows that are not worth starting processes for


@dataclass
class ScoredRows:
    """Scores of M rows of R submissions, and what was found on the way.

    Attributes:
        scores: by name, (R, M).
        floors: scores of the empty room, of cut-outs and of guesses at what is behind, by name,
            (M,); those of OF_TRUTH.
        objects: of each of L objects that count in these rows: `row`, `object` and `pixels`, (L,),
            and its scores by name, (R, L).
        bad: for each row with values that are not finite, or normals of length 0, what is wrong;
            such values have the worst score.
        digests: of what was read of the truth, by row.
    """

    scores: dict[str, Array]
    floors: dict[str, Array]
    objects: dict[str, Array]
    bad: dict[int, ScoringError]
    digests: dict[int, RowDigests]


def score_rows(
    files: Sequence[RoomPredictions],
    truth: RoomsFile,
    rows: Array,
    settings: Settings,
    progress: Progress = lambda done: None,
) -> ScoredRows:
    """Score these M rows in each of R submissions, by the processes or cluster of the settings."""
    scene, view = (truth.read(name, slice(None))[rows] for name in ("scene_index", "view_index"))
    others = rows[other_scenes(scene, view)]
    triples = np.stack([rows, others, first_views(truth)[rows]], axis=-1)
    return _scored(files, truth, triples, (), settings, progress)


def score_measured_rows(
    files: Sequence[RoomPredictions],
    truth: MeasuredFile,
    rows: Array,
    protocols: tuple[str, ...],
    settings: Settings,
    progress: Progress = lambda done: None,
) -> ScoredRows:
    """Score these M rows as `score_rows`; names of scores are `PROTOCOL SCORE`."""
    return _scored(files, truth, rows, protocols, settings, progress)


def _scored(
    files: Sequence[RoomPredictions],
    truth: Images,
    rows: Array,
    protocols: tuple[str, ...],
    settings: Settings,
    progress: Progress,
) -> ScoredRows:
    """Score rows, or triples of them, by the processes or cluster of the settings."""
    chunks = [rows[i : i + CHUNK] for i in range(0, len(rows), CHUNK)]
    submissions = tuple((file.path.absolute(), file.identity) for file in files)
    job = submissions, truth.path.absolute(), protocols, settings.align
    processes = min(settings.processes or processors(), len(chunks))
    few = settings.processes is None and len(rows) <= FEW
    parts: Iterable[ScoredRows]
    if settings.cluster is not None:
        parts = _on_cluster(job, chunks, settings.cluster)
    elif processes == 1 or few:
        parts = _scored_here(_scorer(files, truth, protocols), chunks)
    else:
        parts = _in_processes(job, chunks, processes)
    scored = []
    for part in parts:
        scored.append(part)
        progress(len(part.digests))
    return _joined(scored)


def _joined(parts: Sequence[ScoredRows]) -> ScoredRows:
    """Return the rows of all parts, in their order."""

    def column(kind: str, name: str) -> Array:
        return np.concatenate([getattr(part, kind)[name] for part in parts], axis=-1)

    first = parts[0]
    scores = {name: column("scores", name) for name in first.scores}
    alone = [n for n in scores if n.startswith(OTHER_SCENE) and not np.isfinite(scores[n]).any()]
    return ScoredRows(
        {name: values for name, values in scores.items() if name not in alone},
        {name: column("floors", name) for name in first.floors},
        {name: column("objects", name) for name in first.objects},
        {row: error for part in parts for row, error in part.bad.items()},
        {row: digests for part in parts for row, digests in part.digests.items()},
    )


def other_scenes(scene_index: Array, view_index: Array) -> Array:
    """Return for each of N rows, (N,) each, one of another scene, as indices (N,).

    It is the next scene's in the same view, and the first one's for the last scene; each row is
    that of exactly one other. A constant prediction therefore scores equally against its own and
    the other scene, on average. Rows whose view is in no other scene are paired with each other.
    Rows for which these are all of their own scene are paired with themselves.
    """
    views, index, rows_of = np.unique(view_index, return_inverse=True, return_counts=True)
    group = np.where(rows_of[index] > 1, index, len(views))
    order = np.lexsort((scene_index, group))
    partner = np.arange(len(order))
    for number in np.unique(group):
        rows = order[group[order] == number]
        # So far on, no scene meets itself, unless it has more than half of the rows.
        most = np.unique(scene_index[rows], return_counts=True)[1].max()
        partner[rows] = np.roll(rows, -most)
    same = scene_index[partner] == scene_index
    return np.where(same, np.arange(len(partner)), partner)


def first_views(truth: RoomsFile) -> Array:
    """Return the row of each row's first view of its scene, (N,); -1 where the file lacks it."""
    scene, view = (truth.read(name, slice(None)) for name in ("scene_index", "view_index"))
    at = np.flatnonzero(view == 0)
    row_of = dict(zip(scene[at].tolist(), at.tolist(), strict=True))
    return np.array([row_of.get(number, -1) for number in scene.tolist()])


class RowScorer:
    """Scores rows of open submissions against an open truth."""

    def __init__(self, files: Sequence[RoomPredictions], truth: RoomsFile) -> None:
        """Take files that stay open as long as rows are scored."""
        self._files, self._truth, self._kept = files, truth, KeptBaselines()
        self._entries = [{row: i for i, row in enumerate(f.rows.tolist())} for f in files]

    def score(self, triples: Array) -> ScoredRows:
        """Return the scores of rows, (N, 3) with a row of another scene and the first view of each.

        Values that are not finite are penalised; the caller decides whether that shall count.
        """
        bad: dict[int, ScoringError] = {}
        digests: dict[int, RowDigests] = {}
        images, floors = [], []
        for row, other, first in triples.tolist():
            view = read_true_view(self._truth, row)
            digests[row] = view_digests(view)
            if view.lens.is_flat:
                score, baselines = self._of_plane(view, digests[row], row, other, first)
            else:
                score = functools.partial(score_panorama, truth=view)
                baselines = baselines_of(view)
            scores = []
            for file, entries in zip(self._files, self._entries, strict=True):
                predicted = file.view(entries[row])
                try:
                    scores.append(score(predicted))
                except PredictionError as error:
                    bad[row] = ScoringError(*_placed(error, file, row))
                    scores.append(score(predicted, non_finite="penalise"))
            images.append(scores)
            floors.append(baselines)
        names = images[0][0].scores
        counts = [len(scores[0].objects["object"]) for scores in images]
        objects = {"row": np.repeat(triples[:, 0], counts)}
        for name in images[0][0].objects:
            columns = zip(*images, strict=True)
            runs = [np.concatenate([run.objects[name] for run in column]) for column in columns]
            objects[name] = np.stack(runs) if name in OBJECT_SCORES else runs[0]
        return ScoredRows(
            {
                name: np.array([[run.scores[name] for run in row] for row in images]).T
                for name in names
            },
            {name: np.array([row[name] for row in floors]) for name in floors[0]},
            objects,
            bad,
            digests,
        )

    def _of_plane(
        self, view: TrueView, digests: RowDigests, row: int, other: int, first: int
    ) -> tuple[Callable[..., ImageScores], dict[str, float]]:
        """Return what scores a prediction of an image, and the scores of its baselines."""
        relief, first_view, edges = None, None, None
        if other != row:
            names = ("depth", "camera/world_from_camera")
            depth, pose = (self._truth.read(name, other) for name in names)
            size = self._truth.room_size(other)
            relief = true_relief(depth, pose, self._truth.lens(other), size)
        if first not in (row, -1):
            maps = ("depth", "object_id", "camera/world_from_camera")
            first_view = FirstView(*(self._truth.read(name, first) for name in maps))
        key = key_of(view, digests, first_view, row)
        reference = reference_of(view, first_view, row, kept := self._kept.read(key))
        if kept is None:
            self._kept.write(key, reference.floors)
        if any(file.has_confidence for file in self._files):
            edges = distance_from_edges(self._truth.read("image", row))
        about = {"reference": reference, "other_relief": relief, "edge_distance": edges}
        return functools.partial(score_prediction, truth=view, **about), reference.floors


class MeasuredScorer:
    """Scores rows of open submissions against an open truth that was measured."""

    def __init__(
        self, files: Sequence[RoomPredictions], truth: MeasuredFile, protocols: tuple[str, ...]
    ) -> None:
        """Take files that stay open as long as rows are scored."""
        self._files, self._truth = files, truth
        self._protocols = [BY_NAME[name] for name in protocols]
        self._entries = [{row: i for i, row in enumerate(f.rows.tolist())} for f in files]

    def score(self, rows: Array) -> ScoredRows:
        """Return the scores of rows, (N,), as `RowScorer.score`."""
        bad: dict[int, ScoringError] = {}
        digests: dict[int, RowDigests] = {}
        images = []
        for row in rows.tolist():
            view, runs = self._truth.view(row), []
            edges = None
            if any(file.has_confidence for file in self._files):
                edges = distance_from_edges(self._truth.picture(row))
            for file, entries in zip(self._files, self._entries, strict=True):
                predicted = file.view(entries[row])
                score = functools.partial(
                    scores_of_view, predicted, view, self._protocols, self._truth.dense,
                    row=row, edge_distance=edges,
                )  # fmt: skip
                try:
                    runs.append(score())
                except PredictionError as error:
                    bad[row] = ScoringError(*_placed(error, file, row))
                    runs.append(score(penalise=True))
                except ProtocolError as error:
                    raise error.inside(f"{self._truth.path}: row {row}") from error
            images.append(runs)
            digests[row] = view.digests
        names = {f"{a} {b}": (a, b) for a, b in images[0][0]}
        scores = {
            name: np.array([[run[key] for run in runs] for runs in images]).T
            for name, key in names.items()
        }
        return ScoredRows(scores, {}, {}, bad, digests)


class LayerScorer:
    """Scores rows of open submissions of layers against an open truth that has layers."""

    def __init__(self, files: Sequence[RoomPredictions], truth: RoomsFile) -> None:
        """Take files that stay open as long as rows are scored."""
        self._files, self._truth = files, truth
        self._entries = [{row: i for i, row in enumerate(f.rows.tolist())} for f in files]

    def score(self, triples: Array) -> ScoredRows:
        """Return the scores of rows, (N, 3), as `RowScorer.score`."""
        bad: dict[int, ScoringError] = {}
        digests: dict[int, RowDigests] = {}
        images, floors = [], []
        for row in triples[:, 0].tolist():
            view = read_true_view(self._truth, row)
            digests[row], runs = view_digests(view), []
            layers = read_true_layers(self._truth, row, view)
            for file, entries in zip(self._files, self._entries, strict=True):
                predicted = file.view(entries[row])
                try:
                    runs.append(score_layers(predicted, layers))
                except PredictionError as error:
                    bad[row] = ScoringError(*_placed(error, file, row))
                    runs.append(worst_of_layers(layers))
            images.append(runs)
            floors.append(layers.floors())
        scores = {
            name: np.array([[run[name] for run in runs] for runs in images]).T
            for name in images[0][0]
        }
        none: dict[str, Array] = {name: np.zeros((len(self._files), 0)) for name in OBJECT_SCORES}
        none |= dict.fromkeys(OBJECT_COLUMNS, np.zeros(0, np.int64))
        of_truth = {name: np.array([row[name] for row in floors]) for name in floors[0]}
        return ScoredRows(scores, of_truth, none, bad, digests)


Scorer = RowScorer | MeasuredScorer | LayerScorer


def _placed(error: PredictionError, file: RoomPredictions, row: int) -> tuple[str, str, str, str]:
    """Return an error's fields, with file and row before its place."""
    return f"{file.path}: row {row}: {error.where}", error.found, error.expected, error.hint


def _scored_here(scorer: Scorer, chunks: Sequence[Array]) -> Iterator[ScoredRows]:
    with one_thread():
        yield from map(scorer.score, chunks)


def _in_processes(job: Job, chunks: Sequence[Array], processes: int) -> Iterator[ScoredRows]:
    """Yield what `RowScorer.score` gives for the chunks, in their order."""
    try:
        yield from in_processes(functools.partial(_score_in_worker, job), chunks, processes, _told)
    except LostWorkerError as error:
        hint = error.hint.replace("--workers", "--processes")
        raise ScoringError(job[0][0][0], f"{error.where}: {error.found}", "", hint) from error


def _told(rows: Array) -> str:
    first, last = (int(np.ravel(row)[0]) for row in (rows[0], rows[-1]))  # of triples the first
    return f"scores of rows {first} to {last}"


def _told_of_several(chunks: Sequence[Array]) -> str:
    return _told(np.concatenate(chunks))


def _on_cluster(job: Job, chunks: Sequence[Array], cluster: Cluster) -> Iterator[ScoredRows]:
    """Yield what `RowScorer.score` gives for the chunks, in their order."""
    submissions = tuple((path, on_any_machine(identity)) for path, identity in job[0])
    apart = (submissions, *job[1:])
    tasks = [chunks[i : i + CHUNKS] for i in range(0, len(chunks), CHUNKS)]
    for scored in cluster.results(functools.partial(_score_apart, apart), tasks, _told_of_several):
        yield from scored


def _scorer(files: Sequence[RoomPredictions], truth: Images, protocols: tuple[str, ...]) -> Scorer:
    if isinstance(truth, MeasuredFile):
        return MeasuredScorer(files, truth, protocols)
    return (LayerScorer if files[0].kind == "layers" else RowScorer)(files, truth)


def _opened(job: Job, opening: ExitStack) -> Scorer:
    """Open the files of a job, until the stack is closed."""
    truth = open_images(job[1])
    opening.enter_context(truth)
    files = [open_predictions(path, tried=identity) for path, identity in job[0]]
    for file in files:
        opening.enter_context(file)
    rooms = [file for file in files if isinstance(file, RoomPredictions)]
    for file in rooms:
        file.scored_as = job[3]
    return _scorer(rooms, truth, job[2])


def _score_apart(job: Job, chunks: Sequence[Array]) -> list[ScoredRows]:
    """Score chunks with files that are opened for them alone; a cluster's worker lives on."""
    with ExitStack() as opening:
        return list(_scored_here(_opened(job, opening), chunks))


def _score_in_worker(job: Job, rows: Array) -> ScoredRows:
    return _scorer_of_this_process(job).score(rows)


@functools.cache
def _scorer_of_this_process(job: Job) -> Scorer:
    """Open the files of a job when its first chunk comes; a worker process has only one job."""
    opening = ExitStack()
    atexit.register(opening.close)
    return _opened(job, opening)

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
from metrics.measured.reader import Images, MeasuredFile, is_flat, open_images
from metrics.measures.alignment import Alignment
from metrics.measures.confidence import distance_from_edges
from metrics.scoring.images.image_scores import (
    FirstView,
    ImageScores,
    NonFinite,
    reference_of,
    score_prediction,
    true_relief,
)
from metrics.scoring.images.layers import (
    read_true_layers,
    score_layers,
    true_points,
    worst_of_layers,
)
from metrics.scoring.images.measured_rows import scores_of_view
from metrics.scoring.images.panoramas import baselines_of, score_panorama
from metrics.scoring.kept_baselines import KeptBaselines, key_of
from metrics.scoring.metric_names import OBJECT_SCORES, OTHER_SCENE
from metrics.scoring.records import OBJECT_COLUMNS
from metrics.scoring.runs import Progress, ScoringError, Settings
from metrics.scoring.truth_digests import RowDigests, view_digests
from metrics.submissions.problems import PredictionError
from metrics.submissions.reader import (
    Identity,
    PredictedView,
    RoomPredictions,
    on_any_machine,
    open_predictions,
)
from metrics.submissions.truths import read_true_view
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
    truth: Images,
    rows: Array,
    settings: Settings,
    progress: Progress = lambda done: None,
    protocols: tuple[str, ...] = (),
) -> ScoredRows:
    """Score these M rows in each of R submissions, by the processes or cluster of the settings.

    Names of scores of measured truth are `PROTOCOL SCORE`, for each of the protocols.
    """
    tasks = rows[:, None]
    if isinstance(truth, RoomsFile):
        scene, view = (truth.read(x, slice(None))[rows] for x in ("scene_index", "view_index"))
        others = rows[other_scenes(scene, view)]
        tasks = np.stack([rows, others, first_views(truth)[rows]], axis=-1)
    chunks = [tasks[i : i + CHUNK] for i in range(0, len(tasks), CHUNK)]
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


# What is read of a row once: its digests, scores of OF_TRUTH, and what scores a prediction, which
# gets whether to penalise values that break a rule.
Begun = tuple[RowDigests, dict[str, float], Callable[[PredictedView, bool], ImageScores]]
NO_OBJECTS: dict[str, Array] = {
    **dict.fromkeys(OBJECT_COLUMNS[1:], np.zeros(0, np.int64)),
    **dict.fromkeys(OBJECT_SCORES, np.zeros(0)),
}


class RowScorer:
    """Scores rows of open submissions; `begin` reads the truth of one, as its kind has it."""

    def __init__(self, files: Sequence[RoomPredictions], begin: Callable[..., Begun]) -> None:
        """Take files that stay open as long as rows are scored."""
        self._files, self._begin = files, begin
        self._entries = [{row: i for i, row in enumerate(f.rows.tolist())} for f in files]

    def score(self, rows: Array) -> ScoredRows:
        """Return the scores of rows, (N, 1), of rooms with their `others`, (N, 3).

        Values that are not finite are penalised; the caller decides whether that shall count.
        """
        bad: dict[int, ScoringError] = {}
        digests: dict[int, RowDigests] = {}
        images, floors = [], []
        for row, *others in rows.tolist():
            digests[row], of_truth, score = self._begin(row, *others)
            runs = []
            for file, entries in zip(self._files, self._entries, strict=True):
                predicted = file.view(entries[row])
                try:
                    runs.append(score(predicted, False))
                except PredictionError as error:
                    where = f"{file.path}: row {row}: {error.where}"
                    bad[row] = ScoringError(where, error.found, error.expected, error.hint)
                    runs.append(score(predicted, True))
            images.append(runs)
            floors.append(of_truth)
        first = images[0][0]
        counts = [len(runs[0].objects["object"]) for runs in images]
        objects = {"row": np.repeat(rows[:, 0], counts)}
        for name in first.objects:
            columns = [[run.objects[name] for run in runs] for runs in zip(*images, strict=True)]
            each = [np.concatenate(column) for column in columns]
            objects[name] = np.stack(each) if name in OBJECT_SCORES else each[0]
        return ScoredRows(
            {
                name: np.array([[run.scores[name] for run in runs] for runs in images]).T
                for name in first.scores
            },
            {name: np.array([of_truth[name] for of_truth in floors]) for name in floors[0]},
            objects,
            bad,
            digests,
        )


def _of_rooms(truth: RoomsFile, confident: bool) -> Callable[[int, int, int], Begun]:
    """Return what reads a row, with a row of another scene and its scene's first view."""
    kept, read = KeptBaselines(), truth.read

    def begin(row: int, other: int, first: int) -> Begun:
        view, relief, first_view = read_true_view(truth, row), None, None
        if other != row:
            depth, pose = (read(name, other) for name in ("depth", "camera/world_from_camera"))
            relief = true_relief(depth, pose, truth.lens(other), truth.room_size(other))
        if first not in (row, -1):
            seen = ("depth", "object_id", "camera/world_from_camera")
            first_view = FirstView(*(read(name, first) for name in seen))
        digests = view_digests(view)
        key = key_of(view, digests, first_view, row)
        reference = reference_of(view, first_view, row, known := kept.read(key))
        if known is None:
            kept.write(key, reference.floors)
        edges = distance_from_edges(read("image", row)) if confident else None

        def score(predicted: PredictedView, penalise: bool) -> ImageScores:
            non_finite: NonFinite = "penalise" if penalise else "error"
            return score_prediction(predicted, view, reference, relief, non_finite, edges)

        return digests, reference.floors, score

    return begin


def _of_measured(
    truth: MeasuredFile, confident: bool, protocols: tuple[str, ...]
) -> Callable[[int], Begun]:
    """Return what reads a row; names of its scores are `PROTOCOL SCORE`."""
    chosen = [BY_NAME[name] for name in protocols]

    def begin(row: int) -> Begun:
        view = truth.view(row)
        edges = distance_from_edges(truth.picture(row)) if confident else None

        def score(predicted: PredictedView, penalise: bool) -> ImageScores:
            try:
                found = scores_of_view(predicted, view, chosen, truth.dense, penalise, row, edges)
            except ProtocolError as error:
                raise error.inside(f"{truth.path}: row {row}") from error
            return ImageScores({f"{a} {b}": value for (a, b), value in found.items()}, NO_OBJECTS)

        return view.digests, {}, score

    return begin


def _of_layers(truth: RoomsFile, meshes: bool) -> Callable[[int, int, int], Begun]:
    """Return what reads a row and its layers."""

    def begin(row: int, _other: int, _first: int) -> Begun:
        view = read_true_view(truth, row)
        layers = read_true_layers(truth, row, view)
        surfaces = true_points(truth, row) if meshes else None

        def score(predicted: PredictedView, penalise: bool) -> ImageScores:
            scores_of = worst_of_layers if penalise else score_layers
            return ImageScores(scores_of(predicted, layers, surfaces), NO_OBJECTS)

        return (*view_digests(view), *layers.digests), layers.floors(), score

    return begin


def _of_panoramas(truth: RoomsFile) -> Callable[[int, int, int], Begun]:
    """Return what reads a row that is a panorama."""

    def begin(row: int, _other: int, _first: int) -> Begun:
        view = read_true_view(truth, row)

        def score(predicted: PredictedView, penalise: bool) -> ImageScores:
            return ImageScores(score_panorama(predicted, view, penalise), NO_OBJECTS)

        return view_digests(view), baselines_of(view), score

    return begin


def _scorer(
    files: Sequence[RoomPredictions], truth: Images, protocols: tuple[str, ...]
) -> RowScorer:
    confident = any(file.has_confidence for file in files)
    if isinstance(truth, MeasuredFile):
        return RowScorer(files, _of_measured(truth, confident, protocols))
    if not is_flat(truth):
        return RowScorer(files, _of_panoramas(truth))
    if files[0].kind == "layers":
        meshes = any(file.has_surface_points for file in files)
        return RowScorer(files, _of_layers(truth, meshes))
    return RowScorer(files, _of_rooms(truth, confident))


def _scored_here(scorer: RowScorer, chunks: Sequence[Array]) -> Iterator[ScoredRows]:
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
    return f"scores of rows {rows[0][0]} to {rows[-1][0]}"


def _told_of_several(chunks: Sequence[Array]) -> str:
    return _told(np.concatenate(chunks))


def _on_cluster(job: Job, chunks: Sequence[Array], cluster: Cluster) -> Iterator[ScoredRows]:
    """Yield what `RowScorer.score` gives for the chunks, in their order."""
    submissions = tuple((path, on_any_machine(identity)) for path, identity in job[0])
    apart = (submissions, *job[1:])
    tasks = [chunks[i : i + CHUNKS] for i in range(0, len(chunks), CHUNKS)]
    for scored in cluster.results(functools.partial(_score_apart, apart), tasks, _told_of_several):
        yield from scored


def _opened(job: Job, opening: ExitStack) -> RowScorer:
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
def _scorer_of_this_process(job: Job) -> RowScorer:
    """Open the files of a job when its first chunk comes; a worker process has only one job."""
    opening = ExitStack()
    atexit.register(opening.close)
    return _opened(job, opening)

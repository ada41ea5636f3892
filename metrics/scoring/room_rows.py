"""Predictions of rooms against their truth: every row scored, in processes, always in one order."""

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from metrics.measures.checks import NoDirectionError, NonFiniteError
from metrics.measures.depth import Alignment
from metrics.scoring.item_scores import ALIGNMENTS, NonFinite, TrueView, chamfer_floor, score_view
from metrics.submissions.reader import RoomPredictions, open_predictions
from scenegen.common.errors import SceneGenError
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
CHUNK = 8  # rows scored between two reports of progress
FEW = 32  # rows that are not worth starting processes for
FLOOR_ROWS = 16  # rows that the noise floor is measured on
IDS_SHOWN = 8


class ScoringError(SceneGenError):
    """Predictions that cannot be scored against this truth."""


@dataclass(frozen=True, eq=False)
class RoomScores:
    """Scores of the rows of a rooms file.

    Attributes:
        rows: of the truth that were scored, (M,).
        scene_index, view_index: of each, (M,).
        view_angle_degrees: between each view and its scene's first one, about the vertical, whole
            degrees, (M,).
        scores: by name, (R, M): of each of R runs.
        floor: mean of `item_scores.chamfer_floor` over some rows, scene units.
        penalised: row numbers in which a run held values that are not finite, or normals of
            length 0.
    """

    rows: Array
    scene_index: Array
    view_index: Array
    view_angle_degrees: Array
    scores: dict[str, Array]
    floor: float
    penalised: tuple[int, ...]


def score_rows(
    paths: Sequence[Path],
    truth_path: Path,
    rows: Array,
    alignment: str,
    *,
    non_finite: NonFinite = "error",
    processes: int | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> RoomScores:
    """Score these rows of each submission; the numbers do not depend on `processes`.

    Raises ScoringError where values are not finite and not penalised, with the rows' numbers.
    """
    alignments = tuple(a for a in get_args(Alignment) if a in (*ALIGNMENTS, alignment))
    job = partial(
        _score_chunk,
        tuple(map(str, paths)),
        str(truth_path),
        alignments=alignments,
    )
    chunks = [rows[i : i + CHUNK] for i in range(0, len(rows), CHUNK)]
    table: list[list[dict[str, float]]] = []
    bad: dict[int, str] = {}
    for scored, problems in _run(job, chunks, processes):
        table += scored
        bad |= problems
        progress(len(scored))
    if bad and non_finite == "error":
        first = next(iter(bad))
        shown = ", ".join(map(str, list(bad)[:IDS_SHOWN])) + (
            ", ..." if len(bad) > IDS_SHOWN else ""
        )
        raise ScoringError(
            f"{bad[first]}, row {first}; {len(bad)} rows hold values that cannot be scored:"
            f" {shown}. Mend them, or score them at the worst with --non-finite penalise"
        )
    names = list(table[0][0])
    scores = {name: np.array([[run[name] for run in row] for row in table]).T for name in names}
    with RoomsFile(truth_path) as truth:
        scene = truth.read("scene_index", slice(None))
        view = truth.read("view_index", slice(None))
        angles = view_angles(scene, view, truth.read("camera/world_from_camera", slice(None)))
        some = rows[np.unique(np.linspace(0, len(rows) - 1, FLOOR_ROWS).astype(int))]
        floors = [chamfer_floor(true_view(truth, int(row))) for row in some]
    known = [floor for floor in floors if np.isfinite(floor)]
    return RoomScores(
        rows,
        scene[rows],
        view[rows],
        angles[rows],
        scores,
        float(np.mean(known)) if known else float("nan"),
        tuple(bad),
    )


def true_view(truth: RoomsFile, row: int) -> TrueView:
    """Return what is true of one row."""
    return TrueView(
        truth.read("depth", row),
        truth.read("normal", row),
        truth.read("object_id", row),
        float(truth.read("camera/fov_y_degrees", row)),
    )


def view_angles(scene_index: Array, view_index: Array, world_from_camera: Array) -> Array:
    """Return by how much each view is turned from its scene's first one, (N,) whole degrees.

    About the vertical axis, from 0 to 180; -1 where the scene's first view is not in the file.
    """
    back = world_from_camera[:, :3, 2]
    azimuth = np.degrees(np.arctan2(back[:, 0], back[:, 2]))
    first = {int(scene_index[i]): azimuth[i] for i in np.flatnonzero(view_index == 0)}
    from_first = np.array([first.get(int(scene), np.nan) for scene in scene_index])
    turned = np.abs((azimuth - from_first + 180.0) % 360.0 - 180.0)
    return np.where(np.isfinite(turned), np.rint(turned), -1).astype(np.int64)


def _run(job: Any, chunks: Sequence[Array], processes: int | None) -> Iterator[Any]:
    """Yield the results of the chunks in order."""
    count = min(processes or os.cpu_count() or 1, len(chunks))
    if count == 1 or (processes is None and len(chunks) * CHUNK <= FEW):
        yield from map(job, chunks)
        return
    # Spawned, as forked processes would share open files and threads' locks.
    with ProcessPoolExecutor(count, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(job, chunks)


def _score_chunk(
    paths: Sequence[str],
    truth_path: str,
    rows: Array,
    *,
    alignments: Sequence[Alignment],
) -> tuple[list[list[dict[str, float]]], dict[int, str]]:
    """Score rows: for each row, for each file its scores; and what is not finite, by row.

    Values that are not finite are penalised; the caller decides whether that shall count.
    """
    table, bad = [], {}
    with ExitStack() as stack:
        truth = stack.enter_context(RoomsFile(truth_path))
        files = [stack.enter_context(open_predictions(path)) for path in paths]
        places = [dict(zip(f.rows.tolist(), range(len(f.rows)), strict=True)) for f in files]
        for row in rows.tolist():
            view = true_view(truth, row)
            line = []
            for path, file, place in zip(paths, files, places, strict=True):
                assert isinstance(file, RoomPredictions)
                i = place[row]
                depth, normal = file.depth(i), file.normal(i) if file.has_normals else None
                try:
                    scores = score_view(depth, normal, view, alignments=alignments)
                except (NonFiniteError, NoDirectionError) as error:
                    bad[row] = f"{path}: {error}"
                    scores = score_view(
                        depth, normal, view, alignments=alignments, non_finite="penalise"
                    )
                line.append(scores)
            table.append(line)
    return table, bad

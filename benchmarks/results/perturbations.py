"""What each score sees: the truth, spoilt in one way at a time, in every score with its interval.

    scenegen render --preset shapes --views 0,80 --n 60 --seed 1000 --size 64 --out rooms.h5
    python -m benchmarks.results.perturbations --data rooms.h5 --out what-each-score-sees.svg

Each panel is a score; each line is a way to spoil the truth, at two strengths. The solid line is
perfect, the dashed one the empty room.
"""

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from metrics.in_memory import evaluate
from metrics.measures.empty_room import empty_room
from metrics.scoring.metric_names import OTHER_SCENE, in_order, metric
from metrics.scoring.records import ScoreFile
from scenegen.camera import pixel_directions
from scenegen.rooms.reader import Room, RoomsFile

Array = NDArray[Any]
Spoil = Callable[[Room, float], Array]  # planar depth (H, W) of a room, at a strength
COLUMNS = 6
STRENGTHS = (("#4c9be8", -0.15), ("#c0392b", 0.15))  # colour of either, and its place on the line


def _empty(room: Room) -> Array:
    camera = room.world_from_camera, room.fov_y_degrees
    return empty_room(*camera, room.depth.shape[0], room.depth.shape[1])[0]


def scaled(room: Room, by: float) -> Array:
    """Return all depth longer by this share."""
    return np.asarray(room.depth * (1.0 + by))


def shifted(room: Room, by: float) -> Array:
    """Return all depth longer by this length."""
    return np.asarray(room.depth + by)


def blurred(room: Room, by: float) -> Array:
    """Return depth after a Gaussian blur of this standard deviation, pixels."""
    known = np.isfinite(room.depth)
    filled = np.where(known, room.depth, _empty(room))
    return np.asarray(ndimage.gaussian_filter(filled, by))


def wavy(room: Room, by: float) -> Array:
    """Return depth with waves of this height and a period of 16 pixels."""
    y, x = np.mgrid[: room.depth.shape[0], : room.depth.shape[1]]
    return np.asarray(room.depth + by * np.sin(x * np.pi / 8.0) * np.cos(y * np.pi / 8.0))


def moved(room: Room, by: float) -> Array:
    """Return depth whose objects stand so many pixels farther right."""
    empty = _empty(room)
    relief = np.where(room.object_id > 0, empty - room.depth, 0.0)
    return np.asarray(empty - np.roll(relief, int(by), axis=1))


def removed(room: Room, by: float) -> Array:
    """Return depth without the largest objects, so many of them."""
    ids, pixels = np.unique(room.object_id[room.object_id > 0], return_counts=True)
    gone = ids[np.argsort(-pixels, kind="stable")][: int(by)]
    return np.where(np.isin(room.object_id, gone), _empty(room), room.depth)


def flattened(room: Room, by: float) -> Array:
    """Return depth of which objects keep their median, and this share less of their shape."""
    depth = room.depth.astype(np.float64)
    for number in np.unique(room.object_id[room.object_id > 0]).tolist():
        own = room.object_id == number
        depth[own] += by * (np.median(depth[own]) - depth[own])
    return depth


def tilted(room: Room, by: float) -> Array:
    """Return depth that grows across the picture, by this length from the middle to the side."""
    rays = pixel_directions(room.depth.shape[0], room.depth.shape[1], room.fov_y_degrees)
    return np.asarray(room.depth + by * rays[..., 0] / np.abs(rays[..., 0]).max())


WAYS: Mapping[str, tuple[Spoil, tuple[float, float]]] = {
    "scale": (scaled, (0.01, 0.05)),
    "shift": (shifted, (0.02, 0.1)),
    "tilt": (tilted, (0.02, 0.1)),
    "blur": (blurred, (0.7, 2.0)),
    "waves": (wavy, (0.01, 0.03)),
    "objects moved": (moved, (1.0, 4.0)),
    "objects removed": (removed, (1.0, 2.0)),
    "objects flat": (flattened, (0.5, 1.0)),
}


def scores_of(rooms: RoomsFile, spoil: Callable[[Room], Array]) -> ScoreFile:
    """Return the scores of a file of rooms whose depth is spoilt."""
    return evaluate((spoil(room) for room in rooms), rooms)


def shown_scores(file: ScoreFile) -> list[str]:
    """Return the scores to show: all but those after alignments and those of other scenes."""
    names = [name for name in file.metrics if not name.startswith(OTHER_SCENE)]
    kept = [
        name for name in in_order(names) if "_after_" not in name or name == "abs_rel_after_scale"
    ]
    first = [name for name in kept if name.startswith(("shape", "behind", "relief"))]
    return [*first, *(name for name in kept if name not in first)]


def draw(found: Mapping[str, tuple[ScoreFile, ...]], empty: ScoreFile, out: str | Path) -> None:
    """Draw a panel for each score and write the picture; its suffix tells the format."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams.update({"svg.hashsalt": "scores", "svg.fonttype": "none"})
    from matplotlib import pyplot as plt

    names = shown_scores(empty)
    rows = -(-len(names) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(3.1 * COLUMNS, 1.75 * rows), squeeze=False)
    for name, axis in zip(names, axes.flat, strict=False):
        score = metric(name)
        axis.axvline(1.0 if score.higher_is_better else 0.0, color="black", linewidth=0.8)
        axis.axvline(empty.metrics[name].value, color="grey", linewidth=0.8, linestyle="--")
        for place, files in enumerate(found.values()):
            for file, colour, aside in zip(
                files, ("#4c9be8", "#c0392b"), (-0.15, 0.15), strict=True
            ):
                value = file.metrics[name]
                low, high = value.low or value.value, value.high or value.value
                axis.plot([low, high], [place + aside] * 2, color=colour, linewidth=1.2)
                axis.plot(value.value, place + aside, "o", color=colour, markersize=3)
        axis.set_yticks(range(len(found)), list(found), fontsize=6)
        axis.set_ylim(len(found) - 0.5, -0.5)
        axis.tick_params(axis="x", labelsize=6)
        axis.set_title(name, fontsize=8)
    for axis in axes.flat[len(names) :]:
        axis.set_axis_off()
    figure.tight_layout()
    figure.savefig(out, metadata={"Date": None} if str(out).endswith(".svg") else None, dpi=110)
    plt.close(figure)


def main() -> None:
    """Score all ways to spoil the truth, and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", required=True, help="rooms of several views")
    parser.add_argument("--out", required=True, help="the picture: .svg, .png or .pdf")
    arguments = parser.parse_args()
    found: dict[str, tuple[ScoreFile, ...]] = {}
    with RoomsFile(arguments.data) as rooms:
        empty = scores_of(rooms, _empty)
        for name, (spoil, strengths) in WAYS.items():
            found[name] = tuple(
                scores_of(rooms, partial(spoil, by=strength)) for strength in strengths
            )
            print(name, flush=True)
    draw(found, empty, arguments.out)


if __name__ == "__main__":
    main()

"""Known mistakes of folders: each is undone in turn, and named where that explains the evidence.

A mistake explains a disagreement if at most a share of it remains once the mistake is undone. Data
that are right, noisy or of another quality do not get there. Several mistakes are found one after
another.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.checking.views import View

Array = NDArray[Any]
Error = Callable[[Sequence[View]], float]
BETTER = 0.5  # share of a disagreement that may remain
# The same of a principal point, between posed views: beside the steps in which depths are stored,
# half a pixel of a large image is little.
BETTER_SHIFT = 0.75
BETTER_COLORS = 0.6  # the same of colours, which differ where surfaces shine
ALIKE = 1.05  # factor within which two explanations count as the same: the first is taken
MOST_STEPS = 60  # of the search for a principal point
MOST = 3  # mistakes that are undone one after another
LEAST_FACTOR = 0.002  # logarithm of a focal length or unit that is worth a word
LEAST_SHIFT = 0.2  # pixels of a principal point that are worth a word
UNITS = {
    1000.0: "millimetres for metres", 100.0: "centimetres for metres", 39.37: "inches for metres",
    3.2808: "feet for metres",
}  # fmt: skip
TURNS = np.array([
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
])  # (48, 3, 3): permuted and flipped axes; the first changes nothing  # fmt: skip
PROPER = [turn for turn in TURNS if np.linalg.det(turn) > 0]
NAMED = {
    "x -y -z": "y and z have the other sign (OpenGL's y up for OpenCV's y down, or the reverse)",
    "-x -y z": "x and y have the other sign (turned by 180 degrees)",
}
FLIPS = {  # by the axes of a map
    (1,): "mirrored, left for right", (0,): "upside down", (0, 1): "turned by 180 degrees",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Fault:
    """A mistake of a folder.

    Attributes:
        name: "distance", "planar", "mirrored", "upside-down", "poses", "unit", "focal",
            "principal-point", "normals" or "images".
        size: factor of lengths or of the focal length, or pixels of the principal point; of
            distances how far they exceed the depth at most; () where it has none.
        text: in words.
        undo: returns a view without the mistake.
        better: share of the disagreement that may remain.
        before, after: the disagreement as given, and once the mistake is undone.
    """

    name: str
    size: tuple[float, ...]
    text: str
    undo: Callable[[View], View]
    better: float = BETTER
    before: float = np.nan
    after: float = np.nan


Guesses = Callable[[Sequence[View], Error], Iterator[Fault]]


def explained(
    views: Sequence[View], error: Error, guesses: Guesses, least: float
) -> tuple[list[Fault], Sequence[View]]:
    """Return the mistakes that explain an error, and the views without them.

    An error of `least` or less is that of the steps in which values are stored.
    """
    found: list[Fault] = []
    while len(found) < MOST and (before := error(views)) > least:
        tried = []
        for fault in guesses(views, error):
            after = error([fault.undo(view) for view in views])
            tried.append(
                replace(fault, before=before, after=float(np.nan_to_num(after, nan=np.inf)))
            )
        lowest = min(fault.after for fault in tried)
        best = next(fault for fault in tried if fault.after <= ALIKE * lowest)
        if not best.after <= best.better * before or best.name in {f.name for f in found}:
            break
        views = [best.undo(view) for view in views]
        found.append(best)
    return found, views


def of_geometry(views: Sequence[View], error: Error) -> Iterator[Fault]:
    """Yield the mistakes that depth and cameras may have."""
    first = views[0]
    if first.depth is not None:
        far = float(first.stretch().max())
        yield Fault("distance", (far - 1,), "depth is the distance along the ray, up to"
                    f" {far - 1:.1%} more than planar depth",
                    lambda v: replace(v, depth=v.depth / v.stretch()))  # fmt: skip
        yield Fault("planar", (1 - 1 / far,), "depth is planar where distance along the ray is"
                    " expected", lambda v: replace(v, depth=v.depth * v.stretch()))  # fmt: skip
    for name, axis in (("mirrored", 1), ("upside-down", 0)):
        yield Fault(name, (), f"depth is {FLIPS[axis,]}", partial(_flipped, axis=axis))
    posed = first.world_from_camera is not None
    for inverse in (False, True) if posed else ():
        for turn in PROPER[not inverse :]:
            text = f"poses are of cameras whose {axes_text(turn)}"
            if inverse:
                text = "poses are inverse (camera from world for world from camera, or reverse)"
            yield Fault("poses", (), text, partial(_posed, turn=turn, inverse=inverse))
    if posed and (factor := _factor(views, error, _in_unit, (1e-4, 1e4), 120)):
        unit = next((f", {text}" for f, text in UNITS.items()
                     if abs(np.log(factor / f)) < 0.02), "")  # fmt: skip
        text = f"depth has another unit than the poses: {factor:.4g} times theirs{unit}"
        yield Fault("unit", (factor,), text, partial(_in_unit, factor=1 / factor))
    if factor := _factor(views, error, _focal, (0.4, 2.5), 40):
        text = f"the focal length is {factor:.4g} times that of the images"
        yield Fault("focal", (factor,), text, partial(_focal, factor=1 / factor))
    x, y = _shift(views, error)
    if np.hypot(x, y) >= LEAST_SHIFT:
        text = f"the principal point is off by {x:+.2f}, {y:+.2f} pixels (right, down)"
        better = BETTER_SHIFT if posed else BETTER
        yield Fault("principal-point", (x, y), text, partial(_shifted, x=-x, y=-y), better)


def of_normals(_views: Sequence[View], _error: Error) -> Iterator[Fault]:
    """Yield the mistakes that normals may have."""
    for axis in (1, 0):
        for signs in (1, np.where(np.arange(3) == 1 - axis, -1, 1)):
            undo = partial(_turned, turn=np.eye(3) * signs, axis=axis)
            yield Fault("normals", (), f"normals are {FLIPS[axis,]}, and depth is not", undo)
    for turn in TURNS:
        text = f"normals are in another frame: {axes_text(turn)}"
        yield Fault("normals", (), text, partial(_turned, turn=turn))
        text = "normals are in the world frame, not in the camera's"
        yield Fault("normals", (), text, partial(_turned, turn=turn, of_world=True))


def of_images(_views: Sequence[View], _error: Error) -> Iterator[Fault]:
    """Yield the mistakes that images may have."""
    for axes, words in FLIPS.items():
        text = f"images are {words}, and depth is not"
        yield Fault("images", (), text, partial(_image_flipped, axes=axes), BETTER_COLORS)


def axes_text(turn: Array) -> str:
    """Return in words which axes of the right frame hold x, y and z."""
    letters = axes_letters(turn)
    return NAMED.get(letters, f"axes are {letters.replace(' ', ', ')}")


def axes_letters(turn: Array) -> str:
    """Return which axes hold x, y and z, and with which sign, such as "x -y -z"."""
    return " ".join("-" * int(row.min() < 0) + "xyz"[int(np.abs(row).argmax())] for row in turn)


def _flipped(view: View, axis: int) -> View:
    depth, pixels, across = view.depth, view.pixels, 1 - axis
    if pixels is not None:
        pixels = pixels.copy()
        pixels[:, across] = 2 * view.matrix[across, 2] - pixels[:, across]
    return replace(view, depth=None if depth is None else np.flip(depth, axis), pixels=pixels)


def _posed(view: View, turn: Array, inverse: bool) -> View:
    pose = view.world_from_camera
    assert pose is not None
    pose = np.linalg.inv(pose) if inverse else pose.copy()
    pose[:3, :3] = pose[:3, :3] @ turn
    return replace(view, world_from_camera=pose)


def _in_unit(view: View, factor: float) -> View:
    """Return a view whose depth, or points, are so many times as large beside its pose."""
    pose = view.world_from_camera
    assert pose is not None
    pose = pose.copy()
    pose[:3, 3] /= factor
    return replace(view, world_from_camera=pose)


def _focal(view: View, factor: float) -> View:
    return replace(view, matrix=view.matrix * [[factor, 1, 1], [1, factor, 1], [1, 1, 1]])


def _shifted(view: View, x: float, y: float) -> View:
    return replace(view, matrix=view.matrix + np.array([[0, 0, x], [0, 0, y], [0, 0, 0]]))


def _turned(view: View, turn: Array, axis: int | None = None, of_world: bool = False) -> View:
    """Return a view with its normals in another frame, and flipped along an axis of the image."""
    normal, pose = view.normal, view.world_from_camera
    if normal is None or (of_world and pose is None):
        return replace(view, normal=None)
    if of_world and pose is not None:
        turn = pose[:3, :3].T @ turn
    return replace(view, normal=(normal if axis is None else np.flip(normal, axis)) @ turn.T)


def _image_flipped(view: View, axes: tuple[int, ...]) -> View:
    return view if view.image is None else replace(view, image=np.flip(view.image, axes))


def _factor(
    views: Sequence[View], error: Error, change: Callable[[View, float], View],
    limits: tuple[float, float], steps: int,
) -> float | None:  # fmt: skip
    """Return the factor that has to be undone for the least error; None for 1."""

    def tried(log: float) -> float:
        return error([change(view, float(np.exp(log))) for view in views])

    logs = np.linspace(np.log(limits[0]), np.log(limits[1]), steps + 1)
    best = float(min([*logs.tolist(), 0.0], key=tried))
    width = float(logs[1] - logs[0])
    while width > LEAST_FACTOR / 8:
        best = min(best, *(best + width * k / 4 for k in range(-3, 4)), key=tried)
        width /= 3
    return None if abs(best) < LEAST_FACTOR else float(np.exp(-best))


def _shift(views: Sequence[View], error: Error) -> tuple[float, float]:
    """Return the shift of the principal point that has to be undone for the least error."""

    def tried(at: tuple[float, float]) -> float:
        return error([_shifted(view, *at) for view in views])

    x, y, step = 0.0, 0.0, 4.0
    for _ in range(MOST_STEPS):
        around = [(x + i * step, y + j * step) for i in (0, -1, 1) for j in (0, -1, 1)]
        best = min(around, key=tried)
        if best == (x, y):
            step /= 2
        if step < 0.05:
            break
        x, y = best
    return -x, -y

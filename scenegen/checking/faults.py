"""Known mistakes of folders: each is undone in turn, and named where that explains the evidence.

A mistake explains a disagreement if at most BETTER of it remains once the mistake is undone. Data
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

from scenegen.checking.evidence import (
    Pair,
    apart,
    color_error,
    normal_error,
    normals_of_depth,
)
from scenegen.checking.views import View

Array = NDArray[Any]
Error = Callable[[Sequence[View]], float]
Undo = Callable[[View], View]
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
TURNS = [
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
]  # (48, 3, 3): permuted and flipped axes; the first changes nothing
PROPER = [turn for turn in TURNS if np.linalg.det(turn) > 0]
NAMED = {
    "x -y -z": "y and z have the other sign (OpenGL's y up for OpenCV's y down, or the reverse)",
    "-x -y z": "x and y have the other sign (turned by 180 degrees)",
}
FLIPS = {  # by the axes of a map
    (1,): "mirrored, left for right", (0,): "upside down", (0, 1): "turned by 180 degrees",
}  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """A mistake of a folder.

    Attributes:
        name: "distance", "planar", "mirrored", "upside-down", "poses", "unit", "focal",
            "principal-point", "normals" or "images".
        size: factor of lengths or of the focal length, or pixels of the principal point; of
            distances how far they exceed the depth at most; () where it has none.
        text: in words.
        before, after: the disagreement as given, and once the mistake is undone.
    """

    name: str
    size: tuple[float, ...]
    text: str
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class _Guess:
    name: str
    size: tuple[float, ...]
    text: str
    undo: Undo


def geometry_faults(
    views: Sequence[View], error: Error, least: float
) -> tuple[list[Fault], Sequence[View]]:
    """Return the mistakes of depth and cameras that explain an error, and the views without.

    An error of `least` or less is that of the steps in which values are stored.
    """
    found: list[Fault] = []
    while len(found) < MOST and (before := error(views)) > least:
        tried = [
            (guess, float(np.nan_to_num(error([guess.undo(v) for v in views]), nan=np.inf)))
            for guess in _guesses(views, error)
        ]
        least = min(after for _, after in tried)
        guess, after = next(one for one in tried if one[1] <= ALIKE * least)
        is_shift = guess.name == "principal-point" and views[0].world_from_camera is not None
        most = BETTER_SHIFT if is_shift else BETTER
        if not after <= most * before or guess.name in {fault.name for fault in found}:
            break
        views = [guess.undo(view) for view in views]
        found.append(Fault(guess.name, guess.size, guess.text, before, after))
    return found, views


def _guesses(views: Sequence[View], error: Error) -> Iterator[_Guess]:
    first = views[0]
    if first.depth is not None:
        far = float(first.stretch().max())
        yield _Guess("distance", (far - 1,), "depth is the distance along the ray, up to"
                     f" {far - 1:.1%} more than planar depth",
                     lambda v: replace(v, depth=v.depth / v.stretch()))  # fmt: skip
        yield _Guess("planar", (1 - 1 / far,), "depth is planar where distance along the ray is"
                     " expected", lambda v: replace(v, depth=v.depth * v.stretch()))  # fmt: skip
    for name, axis in (("mirrored", 1), ("upside-down", 0)):
        yield _Guess(name, (), f"depth is {FLIPS[axis,]}", partial(_flipped, axis=axis))
    if first.world_from_camera is not None:
        for inverse in (False, True):
            for turn in PROPER[not inverse :]:
                text = f"poses are of cameras whose {_axes(turn)}"
                if inverse:
                    text = "poses are inverse (camera from world for world from camera, or reverse)"
                undo = partial(_posed, turn=turn, inverse=inverse)
                yield _Guess("poses", (), text, undo)
        if factor := _factor(views, error, _in_unit, (1e-4, 1e4), 120):
            unit = next((f", {text}" for f, text in UNITS.items()
                         if abs(np.log(factor / f)) < 0.02), "")  # fmt: skip
            text = f"depth has another unit than the poses: {factor:.4g} times theirs{unit}"
            yield _Guess("unit", (factor,), text, partial(_in_unit, factor=1 / factor))
    if factor := _factor(views, error, _focal, (0.4, 2.5), 40):
        text = f"the focal length is {factor:.4g} times that of the images"
        yield _Guess("focal", (factor,), text, partial(_focal, factor=1 / factor))
    x, y = _shift(views, error)
    if np.hypot(x, y) >= LEAST_SHIFT:
        text = f"the principal point is off by {x:+.2f}, {y:+.2f} pixels (right, down)"
        yield _Guess("principal-point", (x, y), text, partial(_shifted, x=-x, y=-y))


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


def _axes(turn: Array) -> str:
    """Return in words which axes of the right frame hold x, y and z."""
    letters = " ".join("-" * int(row.min() < 0) + "xyz"[int(np.abs(row).argmax())] for row in turn)
    return NAMED.get(letters, f"axes are {letters.replace(' ', ', ')}")


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


def normal_faults(views: Sequence[View]) -> tuple[list[Fault], float]:
    """Return what is wrong with normals, and the error that remains; NaN without normals."""
    before, tried = normal_error(views), dict[str, float]()
    if not np.isfinite(before):
        return [], before
    for axis in (1, 0):
        signs = np.where(np.arange(3) == 1 - axis, -1, 1)
        flipped = _changed(views, "normal", partial(np.flip, axis=axis))
        pairs = [normals_of_depth(view) for view in flipped]
        errors = [apart([(n * s, expected) for n, expected in pairs]) for s in (signs, 1)]
        tried[f"normals are {FLIPS[axis,]}, and depth is not"] = min(errors)
    pairs = [normals_of_depth(view) for view in views]
    poses = [view.world_from_camera for view in views]
    for turn in TURNS:
        turned = [(n @ turn.T, expected) for n, expected in pairs]
        tried.setdefault(f"normals are in another frame: {_axes(turn)}", apart(turned))
        turned = [
            (n @ (pose[:3, :3].T @ turn).T, expected)
            for (n, expected), pose in zip(pairs, poses, strict=True)
            if pose is not None
        ]
        text = "normals are in the world frame, not in the camera's"
        tried[text] = min(tried.get(text, np.inf), float(np.nan_to_num(apart(turned), nan=np.inf)))
    return _best("normals", tried, before, BETTER)


def _changed(views: Sequence[View], name: str, change: Callable[[Array], Array]) -> list[View]:
    """Return views with another map of this name, where they have one."""
    maps = [getattr(view, name) for view in views]
    return [
        view if values is None else replace(view, **{name: change(values)})
        for view, values in zip(views, maps, strict=True)
    ]


def _best(
    name: str, tried: dict[str, float], before: float, most: float
) -> tuple[list[Fault], float]:
    """Return the text whose error is the least, if that explains an error; and what remains."""
    text, after = min(tried.items(), key=lambda one: one[1])
    if not after <= most * before:
        return [], before
    return [Fault(name, (), text, before, after)], after


def image_faults(views: Sequence[View], pairs: Sequence[Pair]) -> tuple[list[Fault], float]:
    """Return what is wrong with images, and the error that remains; NaN for none."""
    tried = {
        f"images are {words}, and depth is not": color_error(
            _changed(views, "image", partial(np.flip, axis=axes)), pairs
        )
        for axes, words in FLIPS.items()
    }
    return _best("images", tried, color_error(views, pairs), BETTER_COLORS)

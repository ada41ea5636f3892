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
# The same of a principal point: half a pixel of a large image is little beside the steps of depths.
BETTER_SHIFT = 0.75
BETTER_COLORS = 0.6  # the same of colours, which differ where surfaces shine
ALIKE = 1.05  # factor within which two explanations count as the same: the first is taken
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


def geometry_faults(views: Sequence[View], error: Error) -> tuple[list[Fault], Sequence[View]]:
    """Return the mistakes of depth and cameras that explain an error, and the views without."""
    found: list[Fault] = []
    while len(found) < MOST and (before := error(views)) > 0:
        tried = [
            (guess, float(np.nan_to_num(error([guess.undo(v) for v in views]), nan=np.inf)))
            for guess in _guesses(views, error)
        ]
        least = min(after for _, after in tried)
        guess, after = next(one for one in tried if one[1] <= ALIKE * least)
        most = BETTER_SHIFT if guess.name == "principal-point" else BETTER
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
    yield _Guess("mirrored", (), "depth is mirrored, left for right", _mirrored)
    yield _Guess("upside-down", (), "depth is upside down", _upside_down)
    if first.world_from_camera is not None:
        for inverse in (False, True):
            for turn in PROPER[not inverse :]:
                undo = _turned(turn, inverse)
                yield _Guess("poses", (), _pose_text(turn, inverse), undo)
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
        text = f"the principal point is off by ({x:+.2f}, {y:+.2f}) pixels (x right, y down)"
        yield _Guess("principal-point", (x, y), text, partial(_shifted, x=-x, y=-y))


def _mirrored(view: View) -> View:
    depth = None if view.depth is None else view.depth[:, ::-1]
    pixels = view.pixels
    if pixels is not None:
        pixels = np.column_stack([2 * view.matrix[0, 2] - pixels[:, 0], pixels[:, 1]])
    return replace(view, depth=depth, pixels=pixels)


def _upside_down(view: View) -> View:
    depth = None if view.depth is None else view.depth[::-1]
    pixels = view.pixels
    if pixels is not None:
        pixels = np.column_stack([pixels[:, 0], 2 * view.matrix[1, 2] - pixels[:, 1]])
    return replace(view, depth=depth, pixels=pixels)


def _turned(turn: Array, inverse: bool) -> Undo:
    whole = np.eye(4)
    whole[:3, :3] = turn

    def undo(view: View) -> View:
        pose = view.world_from_camera
        assert pose is not None
        return replace(view, world_from_camera=(np.linalg.inv(pose) if inverse else pose) @ whole)

    return undo


def _pose_text(turn: Array, inverse: bool) -> str:
    letters = _letters(turn)
    axes = NAMED.get(letters, f"their axes are {letters.replace(' ', ', ')}")
    if not inverse:
        return f"poses are of cameras whose {axes}" if letters in NAMED else f"of poses {axes}"
    text = "poses are inverse: camera from world where world from camera is expected, or reverse"
    return text if letters in ("x y z", "x -y -z") else f"{text}; {axes}"


def _letters(turn: Array) -> str:
    signs = ("-" if row.min() < 0 else "" for row in turn)
    return " ".join(
        s + "xyz"[int(np.abs(row).argmax())] for s, row in zip(signs, turn, strict=True)
    )


def _in_unit(view: View, factor: float) -> View:
    """Return a view whose depth is so many times as large, of a world in the depth's unit."""
    pose = view.world_from_camera
    assert pose is not None
    moved = pose.copy()
    moved[:3, 3] /= factor
    return replace(view, world_from_camera=moved, points=_scaled(view.points, 1 / factor))


def _scaled(points: Array | None, factor: float) -> Array | None:
    return None if points is None else points * factor


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

    x, y = 0.0, 0.0
    step = 0.5
    while step > 0.05:
        around = [(x + i * step, y + j * step) for i in (0, -1, 1) for j in (0, -1, 1)]
        best = min(around, key=tried)
        if best == (x, y):
            step /= 2
        x, y = best
    return -x, -y


FLIPPED = (
    ("mirrored, left for right", np.s_[:, ::-1], np.diag([-1.0, 1.0, 1.0])),
    ("upside down", np.s_[::-1], np.diag([1.0, -1.0, 1.0])),
)  # maps in these orders, and what becomes of vectors


def normal_faults(views: Sequence[View]) -> tuple[list[Fault], float]:
    """Return what is wrong with normals, and the error that remains; NaN without normals."""
    before = normal_error(views)
    if not np.isfinite(before):
        return [], before
    best, text = before, ""
    for words, order, turn in FLIPPED:
        for signs in (turn, np.eye(3)):
            mirrored = [
                v if v.normal is None else replace(v, normal=v.normal[order] @ signs) for v in views
            ]
            after = normal_error(mirrored)
            if after < best / ALIKE:
                best, text = after, f"normals are {words}, and depth is not"
    pairs = [normals_of_depth(view) for view in views]
    poses = [view.world_from_camera for view in views]
    for of_world in (False, True):
        if of_world and any(pose is None for pose in poses):
            break
        for turn in TURNS:
            whole = [pose[:3, :3].T @ turn if of_world and pose is not None else turn
                     for pose in poses]  # fmt: skip
            turned = [(n @ w.T, expected) for (n, expected), w in zip(pairs, whole, strict=True)]
            after = apart(turned)
            if after < best / ALIKE:
                best, text = after, _normal_text(turn, of_world)
    if not best <= BETTER * before:
        return [], before
    return [Fault("normals", (), text, before, best)], best


def _normal_text(turn: Array, of_world: bool) -> str:
    letters = _letters(turn)
    if of_world:
        return "normals are in the world frame, not in the camera's"
    axes = NAMED.get(letters, f"their axes are {letters.replace(' ', ', ')}")
    return f"normals are in another frame: {axes}"


def image_faults(views: Sequence[View], pairs: Sequence[Pair]) -> tuple[list[Fault], float]:
    """Return what is wrong with images, and the error that remains; NaN for none."""
    flips: dict[str, Callable[[Array], Array]] = {
        "images are mirrored, left for right, and depth is not": lambda image: image[:, ::-1],
        "images are upside down, and depth is not": lambda image: image[::-1],
        "images are turned by 180 degrees, and depth is not": lambda image: image[::-1, ::-1],
    }
    before = color_error(views, pairs)
    tried = {}
    for text, flip in flips.items():
        flipped = [v if v.image is None else replace(v, image=flip(v.image)) for v in views]
        tried[text] = color_error(flipped, pairs)
    text, after = min(tried.items(), key=lambda one: one[1])
    if not after <= BETTER_COLORS * before:
        return [], before
    return [Fault("images", (), text, before, after)], after

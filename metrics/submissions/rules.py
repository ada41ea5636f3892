"""What a submission must be: the rules that writers, the reader, scoring and `validate` ask for.

`RULES` are the conditions on values. `array_problem` holds type and shape against the layout. Both
tell what is wrong as a `Problem`, and `layout.describe_format` prints what they expect.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.answers import ABSTAINED, MOST_CANDIDATES
from metrics.measures.checks import LARGEST_MAGNITUDE
from metrics.submissions.problems import PredictionError, Problem, first_ids
from scenegen.common.errors import SceneGenError
from scenegen.description.specs import MAX_PIXELS
from scenegen.files.schema import Column

Array = NDArray[Any]
Ids = NDArray[np.int64]
Mask = NDArray[np.bool_]

MOST_ROWS = 10_000_000
LAYERS = range(1, 65)  # how many an image may have
# Of depths and normals: what single precision holds. All scores of such values are finite, and so
# are the squares that intervals need of them.
LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True, eq=False)
class Against:
    """What values are held against.

    Attributes:
        count: rows of the truth; None before it is known.
        answers: how many answers each question offers.
        of_scores: the answers that scores give, (M,); None where there are no scores.
        surface: where the truth shows a surface, (H, W); None for other values than pixels.
    """

    count: int | None = None
    answers: int = MOST_CANDIDATES
    of_scores: Ids | None = None
    surface: Mask | None = None


@dataclass(frozen=True)
class Rule:
    """A condition on the values of columns.

    Attributes:
        columns: the names of those that it is for.
        name: in a word, as in `Problem.rule`.
        expected, found: in words; `found` follows the number of entries that break the rule.
        broken: returns which entries or pixels break it.
    """

    columns: tuple[str, ...]
    name: str
    expected: str
    found: str
    broken: Callable[[Array, Against], Any]


def as_doubles(values: Array) -> NDArray[np.float64]:
    """Return stored floats in double precision; NaN of any kind stays NaN, without a warning."""
    with np.errstate(invalid="ignore", over="ignore"):
        return values.astype(np.float64)


def _finite(values: Array, largest: float = LARGEST) -> Mask:
    return np.asarray(np.abs(as_doubles(values)) <= largest)


def _repeated(ids: Array) -> Mask:
    _, first, times = np.unique(ids, return_index=True, return_counts=True)
    repeated = np.zeros(len(ids), bool)
    repeated[first[times > 1]] = True
    return repeated


def _unknown(ids: Array, against: Against) -> Mask:
    none = np.zeros(len(ids), bool)
    return none if against.count is None else np.asarray(ids >= against.count)


def _no_answer(answers: Array, against: Against) -> Mask:
    return np.asarray((answers < ABSTAINED) | (answers >= against.answers))


def _no_rotated(answers: Array, against: Against) -> Mask:
    wrong = _no_answer(answers, against)
    wrong[:, 1:] &= answers[:, 1:] != NOT_ASKED  # the first is `answer`
    return np.asarray(wrong.any(axis=1))


def _other_than_scores(answers: Array, against: Against) -> Mask:
    if against.of_scores is None:
        return np.zeros(len(answers), bool)
    return np.asarray((answers != against.of_scores) & ~_no_answer(answers, against))


def _on_surface(wrong: Any, against: Against) -> Any:
    return wrong if against.surface is None else wrong & against.surface


OUTCOMES = ("answered", "unparsed", "refused", "cut off")  # of the text of a model that was asked
NOT_ASKED = -2  # in this order of the answers, or the model failed
IDS, SURFACE = ("row", "question"), "wherever the ground truth has a surface"
RULES = (
    Rule(IDS, "range", "0 or more", "negative", lambda ids, _: ids < 0),
    Rule(IDS, "unique", "each once", "given more than once", lambda ids, _: _repeated(ids)),
    Rule(IDS, "known", "rows of the ground truth", "that the ground truth does not have", _unknown),
    Rule(
        ("depth", "disparity", "confidence"), "finite", f"finite numbers {SURFACE}",
        "NaN, infinite or huge",
        lambda values, against: _on_surface(~_finite(values), against),
    ),
    Rule(
        ("points", "normal"), "finite", f"finite numbers {SURFACE}", "NaN, infinite or huge",
        lambda vectors, against: _on_surface(~_finite(vectors).all(axis=-1), against),
    ),
    Rule(
        ("surface_points",), "finite", "finite points", "NaN, infinite or huge",
        lambda points, _: ~_finite(points).all(axis=-1),
    ),
    Rule(
        ("layers",), "range", "depths above 0, and NaN behind the last layer",
        "infinite, huge, or at or behind the camera",
        lambda layers, _: ~(np.isnan(layers) | (_finite(layers) & (layers > 0.0))).all(axis=-1),
    ),
    Rule(
        ("layers",), "order", "depths in order, nearest first, without gaps", "not in order",
        lambda layers, _: (~np.isnan(layers[..., 1:]) & ~(layers[..., 1:] >= layers[..., :-1]))
        .any(axis=-1),
    ),
    Rule(
        ("normal",), "length", f"normals of a length above 0 {SURFACE}", "of length 0",
        lambda normal, against: _on_surface(~normal.any(axis=-1), against),
    ),
    Rule(
        ("fov_y_degrees",), "range", "degrees between 0 and 180", "outside of that",
        lambda degrees, _: ~((degrees > 0.0) & (degrees < 180.0)),
    ),
    Rule(
        ("answer",), "range", "the index of an option from 0, or -1", "that are not an option",
        _no_answer,
    ),
    Rule(
        ("rotated",), "range", "indices of options from 0, -1 or -2", "that are not options",
        _no_rotated,
    ),
    Rule(
        ("rotated",), "agreement", "`answer`, in the first column", "that begin with another value",
        lambda answers, against: _other_than_scores(answers[:, 0], against),
    ),
    Rule(
        ("outcome",), "range", f"0 to {len(OUTCOMES) - 1}", "outside of that",
        lambda outcome, _: (outcome < 0) | (outcome >= len(OUTCOMES)),
    ),
    Rule(
        ("scores",), "finite", "finite numbers", "NaN, infinite or huge",
        lambda scores, _: ~_finite(scores, LARGEST_MAGNITUDE).all(axis=1),
    ),
    Rule(
        ("answer",), "agreement", "the highest of scores, -1 where it is tied",
        "that disagree with scores", _other_than_scores,
    ),
)  # fmt: skip


def broken_rules(name: str, values: Array, against: Against) -> Iterator[tuple[Rule, Mask]]:
    """Yield the rules that the values of a column break, and which entries or pixels do."""
    for rule in RULES:
        if name in rule.columns:
            wrong = rule.broken(values, against)
            if wrong.any():
                yield rule, wrong


def value_problems(
    name: str, values: Array, ids: Ids, against: Against | None = None
) -> list[Problem]:
    """Return what is wrong with the M values of a column; their ids, (M,), are told."""
    if not len(values):
        return [Problem(name, "count", "at least one", "no rows")]
    problems = []
    for rule, wrong in broken_rules(name, values, against or Against()):
        found = f"{np.count_nonzero(wrong)} {rule.found}"
        if name == "answer":
            found += f", such as {values[wrong][0]}"
            from_one = values.min() == 1 and values.max() == (against or Against()).answers
            found += "; they look counted from 1" if from_one else ""
        problems.append(Problem(name, rule.name, rule.expected, found, first_ids(ids[wrong])))
    return problems


def refuse_pixels(
    kind: type[SceneGenError], where: str, name: str, values: Array, surface: Mask
) -> None:
    """Raise an error of this kind where an image (H, W, ...) breaks a rule of its column."""
    for rule, wrong in broken_rules(name, values, Against(surface=surface)):
        first = tuple(np.argwhere(wrong)[0].tolist())
        found = f"{rule.found} at {np.count_nonzero(wrong)} pixels, the first at {first}"
        raise kind(where, found, rule.expected)


def refuse_behind_camera(
    where: object, kind: str, alignment: str, geometry: Array, surface: Mask
) -> None:
    """Raise PredictionError where more than half of an image is at or behind the camera.

    Such values can be scored, so this breaks no rule, but it is the mark of a wrong sign. What is
    known up to a shift has no sign.

    Args:
        kind, alignment: as in `layout.KINDS`.
        geometry: (H, W), or points (H, W, 3).
        surface: where the truth shows a surface, (H, W).
    """
    if kind in ("disparity", "layers") or alignment == "scale_shift":
        return
    depth = geometry if kind == "depth" else -geometry[..., 2]
    if 2 * np.count_nonzero(depth[surface] <= 0.0) > np.count_nonzero(surface):
        expected = "planar depth, which is positive in front of the camera"
        if kind == "points":
            expected = "points whose depth, -z, is positive in front of the camera"
        raise PredictionError(f"{where}: {kind}", "most of it at or below 0", expected)


def array_problem(
    column: Column, array: Any, count: int | None, sizes: Mapping[str, Sequence[int]]
) -> Problem | None:
    """Return what is wrong with type or shape of an array, or of a data set that is not read.

    Args:
        column: of the layout; its type says whether floats or integers are expected.
        array: what has a `dtype` and a `shape`.
        count: how many rows there must be; None where any number may be.
        sizes: those that are allowed of each axis, by its name; any where it is not told.
    """
    name = column.name
    shape: tuple[int, ...] = array.shape or ()
    kinds = "f" if is_float(column) else "iu"
    sizes = {"layer": LAYERS, **sizes}
    axes = [sizes.get(axis, ()) for axis in column.axes or ()]
    fits = len(shape) == 1 + len(axes) and all(
        size in allowed if allowed else size > 0
        for size, allowed in zip(shape[1:], axes, strict=True)
    )
    if array.dtype.kind not in kinds:
        unit = ", such as millimetres / 1000" if column.unit == "scene unit" else ""
        return Problem(name, "type", kind_text(column) + unit, f"type {array.dtype!s:.40}")
    if not fits:
        return Problem(name, "shape", shape_text(column, count, sizes), f"shape {array.shape}")
    if count not in (None, shape[0]):
        return Problem(name, "count", f"{count}, one for each id", f"{shape[0]} rows")
    if shape[0] > MOST_ROWS:
        return Problem(name, "count", f"at most {MOST_ROWS:,}", f"{shape[0]} rows")
    if math.prod(shape[1:3]) > MAX_PIXELS:
        found = f"images of {shape[1]}x{shape[2]}"
        return Problem(name, "shape", f"at most {MAX_PIXELS:,} pixels", found)
    return None


def is_float(column: Column) -> bool:
    """Return whether a column holds floats, and not integers."""
    return column.dtype.startswith("float")


def kind_text(column: Column) -> str:
    """Return what a column holds, in a word."""
    return "floats" if is_float(column) else "integers"


def shape_text(column: Column, count: int | None, sizes: Mapping[str, Sequence[int]]) -> str:
    """Return the shape of a column as text, with names for sizes that may be any."""
    axes = [" or ".join(map(str, sizes.get(axis, (axis,)))) for axis in column.axes or ()]
    first = "M" if count is None else str(count)
    return f"({', '.join([first, *axes])}{'' if axes else ','})"

"""The table of all scores: name, unit, which direction is better, and definition.

`docs/scores.md` shows the same table, made by `markdown_table`.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

from scenegen.common.errors import SceneGenError
from scenegen.common.names import did_you_mean

HEADLINE = {
    "rooms": (
        "shape_error", "behind_depth_error", "relief_iou", "chamfer", "hausdorff", "mse_depth",
    ),
    "iqtt": ("iqtt_accuracy",),
    "measured": ("abs_rel", "delta_1", "rmse", "silog"),
}  # fmt: skip
RECALL_WITHIN = ("0.02", "0.05")  # scene units
OBJECT_SCORES = (
    "object_depth_error",
    "object_completeness",
    *(f"object_recall_{limit}" for limit in RECALL_WITHIN),
)  # of single objects, too
EMPTY_ROOM = "empty_room_"  # begins the names of the empty room's own scores
CUT_OUT = "cut_out_"  # begins the names of the scores of flat cut-outs
LEANING = "leaning_"  # the same of cut-outs that lean half as much as a closed room behind them
# Begin the names of the scores of guesses at what the first view does not show.
BALLS, BLOCKS = "balls_", "blocks_"
# Begin the names of the scores of guesses at measured depth, which see no picture.
FLAT, RAMP = "flat_", "ramp_"
OF_TRUTH = (
    EMPTY_ROOM,
    CUT_OUT,
    LEANING,
    BALLS,
    BLOCKS,
    FLAT,
    RAMP,
)  # begin names of scores that no submission has a part in
OTHER_SCENE = "other_scene_"  # begins the names of scores against another scene's relief
OF_EMPTY_ROOM = (
    "chamfer", "hausdorff", "mse_depth", "object_depth_error", "object_completeness",
    "behind_depth_error", "shape_error", "shape_normal_degrees", "derived_shape_normal_degrees",
)  # fmt: skip
OF_CUT_OUT = {
    "behind_depth_error": "of flat cut-outs, each at its object's median depth",
    "shape_error": "of flat cut-outs, each at its object's median depth",
    "shape_normal_degrees": "of each object's mean true normal",
    "derived_shape_normal_degrees": "of each object's mean true normal, derived from depth",
}
OF_LEANING = ("behind_depth_error", "shape_error")
_LEAN = "of cut-outs that lean half as much as the walls behind them, in closed rooms alone"
RELIEF = ("relief_correlation", "relief_iou")
BEHIND = "behind_depth_error"
# Scores that have a skill: what begins the names of the columns that may be the floor, by name.
# The best one is.
SKILLED: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(RELIEF, (OTHER_SCENE,)),
    **dict.fromkeys(OF_EMPTY_ROOM, (EMPTY_ROOM,)),
    # Tops and fronts of furniture are parallel to floor and walls.
    **dict.fromkeys(OF_CUT_OUT, (CUT_OUT, EMPTY_ROOM)),
    "shape_error": (CUT_OUT, EMPTY_ROOM, LEANING),
    BEHIND: (EMPTY_ROOM, CUT_OUT, LEANING, BALLS, BLOCKS),
    **dict.fromkeys(HEADLINE["measured"], (FLAT, RAMP)),
}
# The floors of BEHIND that were shown no more than the method.
SHOWN_AS_MUCH = {
    "scored_view": OF_TRUTH,
    "first_view": (EMPTY_ROOM, BALLS, BLOCKS),
    "no_view": (EMPTY_ROOM,),
}
# Scores that have another definition in score files of format 1.0.
_SURFACES = (
    "chamfer", "accuracy_distance", "completeness_distance", "hausdorff", "f_score_",
    "object_completeness", "object_recall_", "boundary_", "derived_",
    "behind_", "relief_", "shape_", "points_", "local_points_",  # those of points alone
)  # fmt: skip
WHOSE = {
    EMPTY_ROOM: "empty room",
    CUT_OUT: "flat cut-out",
    LEANING: "leaning cut-out",
    BALLS: "balls",
    BLOCKS: "blocks",
    FLAT: "one depth",
    RAMP: "nearer to the lower edge",
    OTHER_SCENE: "against another scene",
}
F_SCORE = "f_score_<threshold>"
DERIVED = "derived_"
_NEAREST = "the predicted depth of an image nearest to the true depth in least squares."
_NEAREST_L1 = "the mean of absolute difference of depth divided by true depth least."
_ALIGNED = {
    "_after_median_scale": (
        "scaled to the truth's median",
        "the same after the predicted depth was scaled to the true median depth of its image.",
    ),
    "_after_scale": ("scaled", f"the same after the scale, at least 0, that brings {_NEAREST}"),
    "_after_scale_shift": (
        "scaled and shifted",
        f"the same after the scale, at least 0, and the shift that bring {_NEAREST}",
    ),
    "_after_scale_l1": (
        "scaled by L1",
        f"the same after the scale, at least 0, that makes {_NEAREST_L1}",
    ),
    "_after_scale_shift_l1": (
        "scaled and shifted by L1",
        f"the same after the scale, at least 0, and the shift that make {_NEAREST_L1}",
    ),
    "_after_disparity_scale_shift": (
        "with disparity scaled and shifted",
        "the same after 1 / depth was fitted to 1 / true depth by a scale, at least 0, and a shift"
        " in least squares; no depth then exceeds the largest true one.",
    ),
}


POINT_ALIGNMENTS = {
    "_after_scale": (
        "scaled",
        "the same after the scale, at least 0, that brings the predicted points of an image nearest"
        " to the true ones in least squares.",
    ),
    "_after_scale_shift": (
        "scaled and shifted",
        "the same after the scale, at least 0, and the shift in space that bring them nearest.",
    ),
}


class UnknownMetricError(SceneGenError):
    """A name that is no score of this benchmark."""


@dataclass(frozen=True)
class Metric:
    """The unit, direction and definition of a score.

    Attributes:
        name: its key in score files.
        title: for the head of a table.
        unit: "fraction" runs from 0 to 1.
        definition: one sentence that defines the score of one image or question.
        largest, smallest: the limits of its values.
        of: what it is computed from.
        lacking: pictures that have no such score: "objects", those without any object that counts;
            "relief", those whose true relief nowhere exceeds `relief.RELIEF_ABOVE`; "inside", those
            without pixels inside objects (`shape.inside_objects`), and "bends", also those whose
            objects are flat; "behind", those that show little that the first view does not;
            "boundary", those whose true depth nowhere jumps; "planes", those in which no pixel has
            a reliable normal from its depth; "partner", those whose view no other scene has; else
            "".
    """

    name: str
    title: str
    task: str
    unit: str
    higher_is_better: bool
    definition: str
    largest: float = math.inf
    smallest: float = 0.0
    lacking: Literal[
        "", "objects", "relief", "inside", "bends", "behind", "boundary", "planes", "partner"
    ] = ""
    of: Literal["points", "depth", "normals", "field of view", "answers"] = "depth"

    def suits(self, task: str) -> bool:
        """Return whether items of a task have this score; a scene unit is 1 m of measured truth."""
        return self.task == task or (task == "measured" and self.name in MEASURED)

    @property
    def direction(self) -> str:
        """The direction that is better, in words."""
        return "higher is better" if self.higher_is_better else "lower is better"

    def worst(self, farthest: float = 0.0) -> float:
        """Return the value of an image in which a prediction is not finite, if that is penalised.

        Of errors without a limit it is one that no surface in the room gets from another.

        Args:
            farthest: true depth of the image, scene units.
        """
        if self.higher_is_better:
            return self.smallest
        if math.isfinite(self.largest):
            return self.largest
        length = max(_LENGTH, farthest)
        lengths = {"scene unit": length, "scene unit squared": length**2}
        return lengths[self.unit] if self.unit in lengths else _WORST[self.unit]


# Of errors without a limit: 4 scene units, or the farthest depth, and depth at the camera.
_LENGTH = 4.0
_WORST = {
    "ratio": 4.0,
    "100 ln": 1000.0,
    "ln": 10.0,
    "log10": 4.0,
    "1 / scene unit": 1000.0,
}


def _distance(name: str, title: str, definition: str, unit: str = "scene unit") -> Metric:
    return Metric(name, title, "rooms", unit, False, definition)


def _share(name: str, title: str, definition: str, task: str = "rooms") -> Metric:
    return Metric(name, title, task, "fraction", True, definition, 1.0)


def _angle(name: str, title: str, definition: str) -> Metric:
    return Metric(name, title, "rooms", "degree", False, definition, 180.0)


_POINTS = tuple(replace(m, of="points") for m in (
    _distance("chamfer", "Chamfer", "`accuracy_distance` + `completeness_distance`; not squared."),
    _distance("accuracy_distance", "Accuracy distance",
              "mean distance from the predicted points to the true surface."),
    _distance("completeness_distance", "Completeness distance",
              "mean distance from the true surface to the predicted points."),
    _distance("chamfer_squared", "Chamfer, squared",
              "mean squared distance from the predicted points to the true surface, plus that from"
              " the true surface to the predicted points.", "scene unit squared"),
    _distance("hausdorff", "Hausdorff", "larger of `hausdorff_forward` and `hausdorff_reverse`."),
    _distance("hausdorff_forward", "Hausdorff, forward",
              "largest distance from a predicted point to the true surface."),
    _distance("hausdorff_reverse", "Hausdorff, reverse",
              "largest distance from the true surface to the predicted points."),
    _distance("hausdorff_95", "Hausdorff, 95%",
              "larger of the 95th percentiles of the distances from predicted points to the true"
              " surface and from there to predicted points."),
    _share(F_SCORE, "F-score",
           "harmonic mean of the fraction of predicted points nearer than the threshold (scene"
           " units) to the true surface, and of the fraction of that nearer to them."),
    _distance("paper_chamfer", "Chamfer, as in the paper",
              "mean distance from the predicted points to the nearest true point, plus that from"
              " the true points to the nearest predicted point."),
    _distance("paper_hausdorff", "Hausdorff, as in the paper",
              "larger of `paper_hausdorff_forward` and `paper_hausdorff_reverse`."),
    _distance("paper_hausdorff_forward", "Hausdorff, forward, as in the paper",
              "largest distance from a predicted point to the nearest true point."),
    _distance("paper_hausdorff_reverse", "Hausdorff, reverse, as in the paper",
              "largest distance from a true point to the nearest predicted point."),
))  # fmt: skip
_DEPTH = (
    _distance("mse_depth", "MSE-depth",
              "mean squared difference of predicted and true planar depth.", "scene unit squared"),
    _distance("rmse", "RMSE", "square root of `mse_depth` of the image."),
    _distance("abs_rel", "AbsRel",
              "mean of absolute difference of depth divided by true depth.", "ratio"),
    _distance("silog", "SILog",
              "standard deviation of ln predicted - ln true depth, times 100; predicted depths up"
              " to 0.001 count as 0.001 and are left out of the mean it subtracts.", "100 ln"),
    *(_share(f"delta_{power}", f"delta {power}",
             "fraction of pixels whose predicted and true depth differ by a factor below"
             f" {factor}.")
      for power, factor in enumerate(("1.25", "1.25^2", "1.25^3"), start=1)),
)  # fmt: skip
_MORE_DEPTH = (
    _distance("sq_rel", "SqRel", "mean squared difference of depth divided by true depth."),
    _distance("rmse_log", "RMSE-log",
              "root mean square of ln predicted - ln true depth; depths up to 0.001 count as 0.001,"
              " as in the next two.", "ln"),
    _distance("log10", "log10",
              "mean absolute difference of the decimal logarithms of depth.", "log10"),
    _distance("irmse", "iRMSE",
              "root mean square of 1 / predicted - 1 / true depth.", "1 / scene unit"),
    _share("boundary_f1", "Boundary F1",
           "harmonic mean of precision and recall of pairs of neighbours whose depths differ by a"
           " ratio above a threshold, each the mean over four directions, 0 where there is none;"
           " weighted mean over ten thresholds from 1.05 to 1.25."),
    replace(_share("boundary_recall", "Boundary recall",
                   "fraction of these pairs of the truth, in all directions together, that the"
                   " prediction has as well; the same mean, over thresholds where the truth has"
                   " any."), lacking="boundary"),
)  # fmt: skip
_POINT_MAPS = tuple(replace(m, of="points") for m in (
    _distance("points_rel", "Points, relative error",
              "mean distance of each predicted point from the true one of its pixel, divided by the"
              " true distance from the camera.", "ratio"),
    _share("points_delta_1", "Points, delta 1",
           "fraction of the pixels where that distance is below a quarter of the smaller distance"
           " from the camera."),
))  # fmt: skip
_LOCAL_POINTS = tuple(replace(m, of=m.of if m.unit == "degree" else "points") for m in (
    replace(_distance("local_points_rel", "Local points, relative error",
                      "mean over objects of the mean distance of points, after scale and shift of"
                      " each object alone, divided by its diameter.", "ratio"), lacking="objects"),
    replace(_share("local_points_delta_1", "Local points, delta 1",
                   "mean over objects of the fraction of pixels where that ratio is below 0.25."),
            lacking="objects"),
    replace(_angle("fov_error_degrees", "Field of view, error",
                   "absolute difference of predicted and true vertical field of view."),
            of="field of view"),
))  # fmt: skip
_NORMALS = tuple(replace(m, of="normals") for m in (
    _angle("normal_mean_degrees", "Normals, mean",
           "mean angle between predicted and true normals."),
    _angle("normal_median_degrees", "Normals, median", "median of these angles in the image."),
    _angle("normal_rmse_degrees", "Normals, RMS", "root mean square of these angles."),
    *(_share(f"normal_within_{limit}", f"Normals within {limit}°",
             f"fraction of these angles below {limit} degrees.")
      for limit in ("5", "7.5", "11.25", "22.5", "30")),
))  # fmt: skip
_OBJECTS = tuple(
    replace(metric, lacking="objects")
    for metric in (
        _distance("object_depth_error", "Objects' depth error",
                  "mean absolute difference of predicted and true planar depth, over the pixels of"
                  " objects."),
        replace(_distance("object_completeness", "Objects' completeness",
                          "mean distance from the true surface of objects to all predicted points."
                          ), of="points"),
        *(replace(_share(f"object_recall_{limit}", f"Objects found within {limit}",
                         "fraction of the objects whose own `object_completeness` is below"
                         f" {limit} scene units."), of="points")
          for limit in RECALL_WITHIN),
        replace(_angle("object_normal_mean_degrees", "Objects' normals, mean",
                       "mean angle between predicted and true normals, over the pixels of objects."
                       ), of="normals"),
        replace(_angle("derived_object_normal_mean_degrees", "Objects' normals, mean, from points",
                       "the same of normals derived from the predicted and from the true points."),
                of="points"),
    )
)  # fmt: skip
_SHAPE = tuple(
    replace(
        metric,
        lacking=metric.lacking or "inside",
        of="normals" if metric.name == "shape_normal_degrees" else "points",
    )
    for metric in (
        _distance("shape_error", "Shape error",
                  "mean error inside objects, after each object's median error is taken off."),
        Metric("shape_correlation", "Shape correlation", "rooms", "correlation", True,
               "correlation inside objects of what predicted and true depth have left after the"
               " least-squares plane of each object.", 1.0, -1.0, "bends"),
        _share("shape_recall_0.02", "Shapes within 0.02",
               "fraction of the objects whose own `shape_error` is below 0.02 scene units."),
        _angle("shape_normal_degrees", "Normals inside objects",
               "mean angle between predicted and true normals inside objects."),
        _angle("derived_shape_normal_degrees", "Normals inside objects, from points",
               "the same of normals derived from the predicted and from the true points."),
    )
)  # fmt: skip
_BEHIND = tuple(
    replace(metric, lacking="behind", of="points")
    for metric in (
        _distance("behind_depth_error", "Depth error behind",
                  "mean error at the pixels of objects that the first view of the scene does not"
                  " see."),
        _share("behind_recall_0.05", "Found behind within 0.05",
               "fraction of the true surface there that is nearer than 0.05 scene units to the"
               " predicted points."),
    )
)  # fmt: skip
_RELIEF = (
    Metric("relief_correlation", "Relief correlation", "rooms", "correlation", True,
           "correlation, over the scored pixels, of predicted with true relief: planar depth of the"
           " empty room minus that of the surface.", 1.0, -1.0, "relief", "points"),
    replace(
        _share("relief_iou", "Segmentation (relief IoU)",
               "pixels where predicted and true relief both exceed 0.05 scene units, divided by"
               " those where either does."),
        lacking="relief", of="points"),
)  # fmt: skip
_ACCURACY = replace(
    _share(
        "iqtt_accuracy",
        "IQTT accuracy",
        "1 where the right answer is given, else 0, abstentions included; chance is 1 / answers.",
        "iqtt",
    ),
    of="answers",
)


def _aligned(metric: Metric, ending: str) -> Metric:
    how, definition = (POINT_ALIGNMENTS if metric in _POINT_MAPS else _ALIGNED)[ending]
    return replace(
        metric,
        name=metric.name + ending,
        title=f"{metric.title}, {how}",
        definition=f"`{metric.name}`: {definition}",
    )


def _derived(metric: Metric) -> Metric:
    return replace(
        metric,
        name=DERIVED + metric.name,
        title=f"{metric.title}, from points",
        definition=f"`{metric.name}` of normals derived from the predicted points, against those"
        " derived in the same way from the true points.",
        of="points",
        lacking="planes",
    )


ALL: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        *_POINTS,
        *_DEPTH,
        *(_aligned(metric, ending) for ending in _ALIGNED for metric in _DEPTH),
        *_MORE_DEPTH,
        *_POINT_MAPS,
        *(_aligned(m, ending) for ending in POINT_ALIGNMENTS for m in _POINT_MAPS),
        *_LOCAL_POINTS,
        *_NORMALS,
        *(_derived(metric) for metric in _NORMALS),
        *_SHAPE,
        *_BEHIND,
        *_OBJECTS,
        *_RELIEF,
        _ACCURACY,
    )
}
MEASURED = frozenset(
    metric.name
    for metric in ALL.values()
    if metric in (*_MORE_DEPTH, *_NORMALS)
    or metric.name.partition("_after_")[0] in {m.name for m in (*_DEPTH, *_POINT_MAPS)}
)  # scores of truth that others measured


def _held_against(begins: str, name: str, whose: str, definition: str, **more: Any) -> Metric:
    """Return a score that a prediction's score `name` is held against."""
    title, text = f"{ALL[name].title}, {whose}", f"`{name}` {definition}"
    return replace(ALL[name], name=begins + name, title=title, definition=text, **more)


_OF_EMPTY = "of the empty room, drawn from the true camera."
_BLIND = (
    "of a guess that sees no picture ({}), fitted as predictions are, in least squares for L1, and"
    " by scale and shift where nothing is."
)
_OTHER = "of the same prediction with the relief of another scene."
ALL |= {
    one.name: one
    for one in (
        *(_held_against(EMPTY_ROOM, name, "empty room", _OF_EMPTY) for name in OF_EMPTY_ROOM),
        *(_held_against(CUT_OUT, name, "cut-out", f"{of}.") for name, of in OF_CUT_OUT.items()),
        *(_held_against(LEANING, name, WHOSE[LEANING], f"{_LEAN}.") for name in OF_LEANING),
        *(
            _held_against(guess, name, WHOSE[guess], _BLIND.format(WHOSE[guess]), task="measured")
            for guess in (FLAT, RAMP)
            for name in HEADLINE["measured"]
        ),
        *(
            _held_against(
                guess, BEHIND, WHOSE[guess],
                f"of {WHOSE[guess]} in place of the first view's objects.",
            )
            for guess in (BALLS, BLOCKS)
        ),
        *(_held_against(OTHER_SCENE, n, "other scene", _OTHER, lacking="partner") for n in RELIEF),
    )
}  # fmt: skip
_PLACES = {name: place for place, name in enumerate(ALL)}


def unit_in(name: str, length: str) -> str:
    """Return the unit of a score; `length` is that of lengths, "scene unit" or "metre"."""
    return metric(name).unit.replace("scene unit", length)


def metric(name: str) -> Metric:
    """Return the score of this name; F-scores carry their threshold, such as `f_score_0.05`.

    Raises UnknownMetricError.
    """
    threshold = _threshold(name)
    if threshold is not None:
        return replace(ALL[F_SCORE], name=name, title=f"F-score at {threshold:g}")
    if name not in ALL or name == F_SCORE:
        hint = did_you_mean(name, ALL)
        raise UnknownMetricError("score", f"{name!r:.60}", "a name listed in docs/scores.md", hint)
    return ALL[name]


def changed(name: str) -> bool:
    """Return whether a score has another definition in score files of format 1.0."""
    return name.startswith(_SURFACES)


def in_order(names: Iterable[str]) -> list[str]:
    """Return names in the order of the table, F-scores by threshold, unknown names last."""

    def place(name: str) -> tuple[int, float, str]:
        threshold = _threshold(name)
        if threshold is not None:
            return _PLACES[F_SCORE], threshold, name
        return _PLACES.get(name, len(_PLACES)), 0.0, name

    return sorted(names, key=place)


def _threshold(name: str) -> float | None:
    """Return the threshold in the name of an F-score; it has one spelling only, that of `:g`."""
    match = re.fullmatch(r"f_score_([0-9][0-9.e+-]{0,15})", name)
    try:
        threshold = float(match[1]) if match else 0.0
    except ValueError:
        return None
    valid = match and 0.0 < threshold < math.inf and f"{threshold:g}" == match[1]
    return threshold if valid else None


def markdown_table() -> str:
    """Return all scores as the Markdown table of docs/scores.md."""
    same = ("the same",) * 4
    forms = [
        (f"<depth score>{ending}", *same, definition)
        for ending, (_, definition) in _ALIGNED.items()
    ]
    points = [
        (f"<point score>{ending}", *same, definition)
        for ending, (_, definition) in POINT_ALIGNMENTS.items()
    ]
    of_these = ", ".join(f"`{name}`" for name in OF_EMPTY_ROOM)
    floor = f"the same of the empty room, for {of_these}; in `items` alone."
    flat = "; ".join(f"`{name}` {whose}" for name, whose in OF_CUT_OUT.items())
    other = "the same of the prediction with the relief of another scene, seen in the same view."
    leaning = " and ".join(f"`{name}`" for name in OF_LEANING) + f" {_LEAN}; in `items` alone."
    guesses = f"`{BEHIND}` of {BALLS[:-1]} and {BLOCKS[:-1]}; in `items` alone."
    blind = "the same of guesses that see no picture, of measured truth; in `items` alone."
    derived = "the same of normals derived from the predicted and from the true points."
    rows = [
        *map(_cells, (*_SHAPE, *_BEHIND, *_RELIEF, *_OBJECTS, *_POINTS, *_DEPTH)),
        *forms,
        *map(_cells, (*_MORE_DEPTH, *_POINT_MAPS)),
        *points,
        *map(_cells, (*_LOCAL_POINTS, *_NORMALS)),
        (f"{DERIVED}<normal score>", "points", *same[1:], derived),
        (f"{OTHER_SCENE}<relief score>", *same[:2], "-", "the same", other),
        (f"{EMPTY_ROOM}<score>", *same, floor),
        (f"{CUT_OUT}<score>", *same, f"{flat}; in `items` alone."),
        (f"{LEANING}<score>", *same, leaning),
        (f"{BALLS}{BEHIND}`, `{BLOCKS}{BEHIND}", *same, guesses),
        (f"{FLAT}<score>`, `{RAMP}<score>", *same, blind),
        _cells(_ACCURACY),
    ]
    lines = [f"| `{name}` | {' | '.join(cells)} |" for name, *cells in rows]
    head = ["| name | of | unit | better | worst | definition |", "| --- " * 6 + "|"]
    return "\n".join([*head, *lines])


def _cells(m: Metric) -> tuple[str, str, str, str, str, str]:
    better = "higher" if m.higher_is_better else "lower"
    return m.name, m.of, m.unit, better, f"{m.worst():g}", m.definition

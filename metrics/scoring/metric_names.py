"""The table of all metrics: one row each, with what files, commands and pages say of it.

To add a metric: write its function in `metrics.measures`, call it where images are scored, and add
a row here. All lists of metrics are read from these rows: the order in files and tables, what is
printed first, units, directions, bounds, baselines of skills, roots, and `docs/data/metrics.csv`,
which `python -m metrics.scoring.metric_names` prints.
"""

import csv
import io
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from metrics.submissions.layout import Shown
from scenegen.common.errors import SceneGenError
from scenegen.common.names import did_you_mean

F_SCORE = "f_score_<threshold>"
BEHIND = "behind_depth_error"


class UnknownMetricError(SceneGenError):
    """A name that is no score of this benchmark."""


@dataclass(frozen=True)
class Baseline:
    """What a metric's skill is measured against.

    Attributes:
        name, gloss: for tables, and what it is in a few words.
        definition: completes "`metric`: that of ...".
        needs: the least of a scene that it is made from, among what a method may be shown.
        of_truth: whether it follows from the truth alone, and no submission has a part in it.
    """

    name: str
    gloss: str
    definition: str
    needs: Shown = "scored_view"
    of_truth: bool = True


# By what begins the names of their scores, which stand in the items of score files.
EMPTY_ROOM, CUT_OUT, LEANING = "empty_room_", "cut_out_", "leaning_"
BALLS, BLOCKS, FLAT, RAMP = "balls_", "blocks_", "flat_", "ramp_"
OTHER_SCENE, HALF, LIFTED = "other_scene_", "half_resolution_", "lifted_"
RANDOM_ORDER, EDGE_DISTANCE = "random_order_", "edge_distance_"
CONSTANT, SIZED = "constant_thickness_", "size_thickness_"
INFLATED, MIRRORED = "inflated_mask_", "mirrored_front_"
_GIVEN = " behind the true front, in the true mask, by the factor that is best for the image."
_BLIND = (
    " without the image, fitted as predictions are; by least squares in place of L1, and by scale"
    " and shift in place of no alignment."
)
BASELINES = {
    EMPTY_ROOM: Baseline(
        "empty room", "no objects", "the empty room, drawn from the true camera.",
        needs="no_view",
    ),
    CUT_OUT: Baseline(
        "cut-out", "flat objects at their true depth",
        "flat cut-outs, each at its object's median depth; of normals, each object's mean true"
        " normal.",
    ),
    LEANING: Baseline(
        "leaning cut-out", "cut-out slanted half as much as the wall behind it",
        "cut-outs slanted half as much as the walls behind them, in closed rooms only.",
    ),
    LIFTED: Baseline(
        "lifted masks", "true masks at one fitted distance",
        "the true masks of objects, moved in front of the empty room by one distance that is fitted"
        " to the ground truth of each image.",
    ),
    FLAT: Baseline(
        "constant", "one fitted depth per image",
        f"one depth for all pixels,{_BLIND}",
    ),
    RAMP: Baseline(
        "ramp", "depth that falls linearly to the bottom edge, fitted",
        f"depth that falls evenly to the lower image border,{_BLIND}",
    ),
    BALLS: Baseline(
        "balls", "a sphere proxy per object of the first view",
        "sphere proxies of the first view's objects.", needs="first_view",
    ),
    BLOCKS: Baseline(
        "blocks", "a box proxy per object of the first view",
        "box proxies of the first view's objects.", needs="first_view",
    ),
    CONSTANT: Baseline(
        "constant thickness", "true masks and fronts, one thickness for the image",
        f"one thickness for all objects{_GIVEN}",
    ),
    SIZED: Baseline(
        "thickness by size", "true masks and fronts, thickness by the size of the mask",
        f"a thickness proportional to the square root of the mask's area{_GIVEN}",
    ),
    INFLATED: Baseline(
        "inflated masks", "true masks and fronts, as thick as round bodies",
        f"bodies that are round over the masks, as thick as 2 sqrt(e (2 r - e)){_GIVEN}",
    ),
    MIRRORED: Baseline(
        "mirrored front", "true masks and fronts, mirrored",
        "the true front of each object, mirrored at its farthest visible depth.",
    ),
    HALF: Baseline(
        "half resolution", "ground-truth depth, downsampled and upsampled by 2",
        "the true depth, averaged over 2 x 2 pixels and enlarged bilinearly.",
    ),
    OTHER_SCENE: Baseline(
        "shuffled", "same predictions, scored against other scenes",
        "the same prediction against the relief of another scene in the same view.",
        of_truth=False,
    ),
    RANDOM_ORDER: Baseline(
        "random order", "confidence in a random order",
        "a confidence in random order.", of_truth=False,
    ),
    EDGE_DISTANCE: Baseline(
        "edge distance", "distance to the nearest brightness edge as confidence",
        "the distance from the nearest brightness edge as confidence.", of_truth=False,
    ),
}  # fmt: skip
OF_TRUTH = tuple(begins for begins, baseline in BASELINES.items() if baseline.of_truth)
_SEEN: Sequence[Shown] = ("no_view", "first_view", "scored_view")  # ever more

Lacking = Literal[
    "", "objects", "relief", "inside", "bends", "behind", "boundary", "planes", "partner", "edges",
    "pairs", "order", "order within", "order between", "solids",
    "layer 3", "layer 4", "hidden objects",
    "meshes",
]  # fmt: skip
# The kinds of test sets, which differ in their headline: `ScoreFile.kind`.
KINDS = ("rooms", "interiors", "layers", "measured", "iqtt")  # layers: of either kind of rooms


@dataclass(frozen=True)
class Metric:
    """A row of the table.

    Attributes:
        name: its key in score files.
        title: for the head of a table.
        unit: "fraction" runs from 0 to 1.
        definition: one sentence that defines the score of one image or question.
        of: what it is computed from.
        higher_is_better: its direction.
        largest, smallest: the limits of its values.
        tasks: whose items have it. A scene unit is 1 m of measured truth.
        headline: its place among the main metrics, by the kind of the test set. The first ranks.
        printed: its place in what `bench score` prints of rooms; 0 where it is not.
        baselines: keys of BASELINES; the best one is the 0 of its skill.
        forms: key of FORMS: which further metrics are made of it.
        of_objects: whether single objects have it, too.
        is_root: whether it is the root of a mean of squares. Over pixels of several images it is
            one root of them all.
        redefined: whether it has another definition in score files of format 1.0.
        lacking: pictures that have no such score: "objects", those without any object that counts;
            "relief", those whose true relief nowhere exceeds `relief.RELIEF_ABOVE`; "inside", those
            without pixels inside objects (`shape.inside_objects`), and "bends", also those whose
            objects are flat; "behind", those that show little that the first view does not;
            "boundary", those whose true depth nowhere jumps; "planes", those in which no pixel has
            a reliable normal from its depth; "partner", those whose view no other scene has;
            "edges", those without an occlusion edge; "pairs" and "order", those without the pairs
            of pixels that `measures.pairs` compares; "solids", those in which no ray first
            meets a solid; "layer 3", "layer 4" and "hidden objects", those without such layers or
            objects; "meshes", those of submissions without meshes; else "".
        unchanged_by: what may be fitted to the truth without a change of the value.
        signed: whether the value is a bias, which is best at 0 and ranks nothing.
    """

    name: str
    title: str
    unit: str
    definition: str
    of: Literal[
        "points", "depth", "normals", "field of view", "answers", "confidence", "layers"
    ] = "depth"
    higher_is_better: bool = False
    largest: float = math.inf
    smallest: float = 0.0
    tasks: tuple[str, ...] = ("rooms",)
    headline: Mapping[str, int] = field(default_factory=dict, hash=False)
    printed: int = 0
    baselines: tuple[str, ...] = ()
    forms: Literal["", "depth", "points", "normals"] = ""
    of_objects: bool = False
    is_root: bool = False
    redefined: bool = False
    lacking: Lacking = ""
    unchanged_by: Literal["", "scale", "scale_shift"] = ""
    signed: bool = False

    @property
    def direction(self) -> str:
        """The direction that is better, in words."""
        return f"{self.better} is better"

    @property
    def better(self) -> str:
        """The better direction in a word."""
        if self.signed:
            return "nearer 0"
        return "higher" if self.higher_is_better else "lower"

    def baselines_shown(self, shown: Shown) -> list[str]:
        """Return those baselines that know no more of a scene than a method that is shown this.

        Only what is behind is told apart by that: who is not shown it knows less.
        """
        most = _SEEN.index(shown) if self.name == BEHIND else len(_SEEN)
        return [key for key in self.baselines if _SEEN.index(BASELINES[key].needs) <= most]

    def worst(self, farthest: float = 0.0) -> float:
        """Return the value of an image in which a prediction is not finite, if that is penalised.

        Of errors without a limit it is one that no surface in the room gets from another.

        Args:
            farthest: true depth of the image, scene units.
        """
        if self.higher_is_better:
            return max(self.smallest, -_WORST["ratio"])
        if math.isfinite(self.largest):
            return self.largest
        length = max(_LENGTH, farthest)
        lengths = {"scene unit": length, "scene unit squared": length**2}
        return lengths[self.unit] if self.unit in lengths else _WORST[self.unit]


# Of errors without a limit: 4 scene units, or the farthest depth, and depth at the camera.
_LENGTH = 4.0
_WORST = {"ratio": 4.0, "100 ln": 1000.0, "ln": 10.0, "log10": 4.0, "1 / scene unit": 1000.0,
          "log2": 10.0}  # fmt: skip


SAWA_H_WORST = 3.65 + 0.18 + 0.01 + 0.20 + 1.94 * math.pi  # everything wrong


def _error(name: str, title: str, definition: str, unit: str = "scene unit", **more: Any) -> Metric:
    return Metric(name, title, unit, definition, **more)


def _share(name: str, title: str, definition: str, **more: Any) -> Metric:
    return Metric(name, title, "fraction", definition, higher_is_better=True, largest=1.0, **more)


def _correlation(name: str, title: str, definition: str, **more: Any) -> Metric:
    limits: dict[str, Any] = {"largest": 1.0, "smallest": -1.0}
    return Metric(name, title, "correlation", definition, higher_is_better=True, **limits, **more)


def _angle(name: str, title: str, definition: str, **more: Any) -> Metric:
    return Metric(name, title, "degree", definition, **{"largest": 180.0, **more})


# What several rows share.
_SURFACE: dict[str, Any] = {"of": "points", "redefined": True}
_PAPER: dict[str, Any] = {"of": "points"}
_ANYWHERE: dict[str, Any] = {"tasks": ("rooms", "measured")}
_DEPTH = _ANYWHERE | {"forms": "depth"}
_BLINDLY: dict[str, Any] = {"baselines": (FLAT, RAMP)}
_NO_SHAPE = (LIFTED, EMPTY_ROOM, FLAT, RAMP)
_ORDER: dict[str, Any] = _ANYWHERE | {"unchanged_by": "scale_shift"}
_POINT_MAP = _ANYWHERE | _SURFACE | {"forms": "points"}
_NORMAL = _ANYWHERE | {"of": "normals", "forms": "normals"}
_INSIDE: dict[str, Any] = {"lacking": "inside", "redefined": True}
_BEHIND = _SURFACE | {"lacking": "behind"}
_OBJECT: dict[str, Any] = {"lacking": "objects", "of_objects": True}
_RELIEF = _SURFACE | {"lacking": "relief", "baselines": (OTHER_SCENE,)}
_LAYERS: dict[str, Any] = {"of": "layers", "lacking": "solids"}
_MESHES = _LAYERS | {"lacking": "meshes"}
# Tops and fronts of furniture are parallel to floor and walls, so the empty room may be better.
_FLAT_OR_EMPTY = (CUT_OUT, EMPTY_ROOM)

TABLE: Sequence[Metric] = (
    _error("chamfer", "Chamfer", "`accuracy_distance` + `completeness_distance`; not squared.",
           headline={"rooms": 4}, printed=4, baselines=(EMPTY_ROOM,), **_SURFACE),
    _error("accuracy_distance", "Accuracy distance",
           "mean distance from the predicted points to the true surface.", **_SURFACE),
    _error("completeness_distance", "Completeness distance",
           "mean distance from the true surface to the predicted points.", **_SURFACE),
    _error("chamfer_squared", "Chamfer, squared",
           "mean squared distance from the predicted points to the true surface, plus that from the"
           " true surface to the predicted points.", "scene unit squared", **_SURFACE),
    _error("hausdorff", "Hausdorff", "larger of `hausdorff_forward` and `hausdorff_reverse`.",
           headline={"rooms": 5}, printed=5, baselines=(EMPTY_ROOM,), **_SURFACE),
    _error("hausdorff_forward", "Hausdorff, forward",
           "largest distance from a predicted point to the true surface.", **_SURFACE),
    _error("hausdorff_reverse", "Hausdorff, reverse",
           "largest distance from the true surface to the predicted points.", **_SURFACE),
    _error("hausdorff_95", "Hausdorff, 95%",
           "larger of two 95th percentiles: of the distances from predicted points to the true"
           " surface, and of the distances from the true surface to the predicted points.",
           **_SURFACE),
    _share(F_SCORE, "F-score",
           "harmonic mean of precision and recall. Precision is the fraction of predicted points"
           " whose distance to the true surface is below the threshold, in scene units. Recall is"
           " the fraction of the true surface whose distance to the predicted points is below it.",
           **_SURFACE),
    _error("paper_chamfer", "Chamfer, as in the paper",
           "mean distance from the predicted points to the nearest true point, plus that from the"
           " true points to the nearest predicted point.", **_PAPER),
    _error("paper_hausdorff", "Hausdorff, as in the paper",
           "larger of `paper_hausdorff_forward` and `paper_hausdorff_reverse`.", **_PAPER),
    _error("paper_hausdorff_forward", "Hausdorff, forward, as in the paper",
           "largest distance from a predicted point to the nearest true point.", **_PAPER),
    _error("paper_hausdorff_reverse", "Hausdorff, reverse, as in the paper",
           "largest distance from a true point to the nearest predicted point.", **_PAPER),
    _error("mse_depth", "MSE-depth", "mean squared difference of predicted and true planar depth.",
           "scene unit squared", headline={"rooms": 6}, printed=3, baselines=(EMPTY_ROOM,),
           **_DEPTH),
    _error("rmse", "RMSE", "square root of `mse_depth` of the image.", headline={"measured": 3},
           is_root=True, **_BLINDLY, **_DEPTH),
    _error("abs_rel", "AbsRel", "mean of absolute difference of depth divided by true depth.",
           "ratio", headline={"measured": 1, "interiors": 1}, printed=1, baselines=_NO_SHAPE,
           **_DEPTH),
    _error("silog", "SILog",
           "100 times the standard deviation of ln(predicted depth) - ln(true depth). Predicted"
           " depths below 0.001 are replaced by 0.001 and are left out of the mean.", "100 ln",
           headline={"measured": 4}, **_BLINDLY, **_DEPTH),
    _share("delta_1", "delta 1",
           "fraction of pixels whose predicted and true depth differ by a factor below 1.25.",
           headline={"measured": 2, "interiors": 2}, printed=2, baselines=_NO_SHAPE,
           **_DEPTH),
    _share("delta_1.03", "delta 1.03",
           "fraction of pixels whose predicted and true depth differ by a factor below 1.03.",
           **_DEPTH),
    *(_share(f"delta_{power}", f"delta {power}",
             "fraction of pixels whose predicted and true depth differ by a factor below"
             f" 1.25^{power}.", **_DEPTH)
      for power in (2, 3)),
    _error("sq_rel", "SqRel", "mean squared difference of depth divided by true depth.",
           **_ANYWHERE),
    _error("rmse_log", "RMSE-log",
           "root mean square of ln(predicted depth) - ln(true depth); predicted depths below 0.001"
           " are replaced by 0.001.",
           "ln", is_root=True, **_ANYWHERE),
    _error("log10", "log10",
           "mean absolute difference of log10 of depth; predicted depths below 0.001 are replaced"
           " by 0.001.",
           "log10", **_ANYWHERE),
    _error("irmse", "iRMSE",
           "root mean square of 1 / predicted depth - 1 / true depth; predicted depths below 0.001"
           " are replaced by 0.001.",
           "1 / scene unit", is_root=True, **_ANYWHERE),
    _share("boundary_f1", "Boundary F1",
           "F1 score of the pairs of neighbouring pixels whose depth ratio exceeds a threshold."
           " Precision and recall are means over four directions. The score is a weighted mean"
           " over ten thresholds from 1.05 to 1.25.", redefined=True,
           headline={"measured": 6, "interiors": 4}, baselines=(EMPTY_ROOM, CUT_OUT),
           unchanged_by="scale", **_ANYWHERE),
    _share("boundary_recall", "Boundary recall",
           "fraction of the true boundary pairs of `boundary_f1` that are also boundary pairs of"
           " the prediction; weighted mean over thresholds.",
           lacking="boundary", redefined=True, unchanged_by="scale", **_ANYWHERE),
    _error("flying_points", "Flying points",
           "fraction of the pixels near an occlusion edge whose predicted depth is between the two"
           " surfaces. Near means at most 2 pixels. Between means more than 5% of the distance of"
           " the surfaces away from both.", "fraction",
           largest=1.0, lacking="edges", baselines=(HALF,)),
    _angle("relative_normal_degrees", "Relative normals",
           "mean error of the angle between the normals of two pixels that are on the same object"
           " and up to 32 pixels apart; mean over four scales. Without object ids, the pixels have"
           " no depth edge between them.", of="points",
           lacking="pairs", headline={"measured": 7, "interiors": 5},
           baselines=(CUT_OUT, EMPTY_ROOM, FLAT),
           unchanged_by="scale", **_ANYWHERE),
    _share("ordinal_accuracy", "Ordinal accuracy",
           "fraction of pairs of pixels for which the predicted depths have the same order as the"
           " true depths. True depths of a pair differ by a factor above 1.02.",
           lacking="order", **_ORDER),
    _share("ordinal_accuracy_within", "Ordinal accuracy within objects",
           "`ordinal_accuracy` of pairs on one object.", lacking="order within",
           unchanged_by="scale_shift"),
    _share("ordinal_accuracy_between", "Ordinal accuracy between objects",
           "`ordinal_accuracy` of pairs on two objects, or on an object and the room.",
           lacking="order between",
           unchanged_by="scale_shift"),
    _error("sawa_h", "SAWA-H",
           "weighted sum of five errors (arXiv 2510.19814): depth order, depth after two"
           " alignments, boundaries and relative normals.",
           "weighted sum", largest=SAWA_H_WORST, of="points", unchanged_by="scale", **_ANYWHERE),
    _error("scale_log2", "Scale",
           "log2 of the median, over pixels, of predicted depth divided by true depth.", "log2",
           smallest=-math.inf, signed=True, **_ANYWHERE),
    _error("points_rel", "Points, relative error",
           "mean distance between predicted and true point of a pixel, divided by the true distance"
           " from the camera.", "ratio", headline={"measured": 5, "interiors": 3},
           baselines=_NO_SHAPE, **_POINT_MAP),
    _share("points_delta_1", "Points, delta 1",
           "fraction of pixels where the distance between predicted and true point is below a"
           " quarter of the smaller distance from the camera.", **_POINT_MAP),
    _error("local_points_rel", "Local points, relative error",
           "mean distance between predicted and true points of an object, divided by the diameter"
           " of the object; mean over objects. Each object is aligned by scale and shift.",
           "ratio", lacking="objects", **_SURFACE),
    _share("local_points_delta_1", "Local points, delta 1",
           "mean over objects of the fraction of pixels where the ratio of `local_points_rel` is"
           " below 0.25.", lacking="objects", **_SURFACE),
    _angle("fov_error_degrees", "Field of view, error",
           "absolute difference of predicted and true vertical field of view.",
           of="field of view"),
    _angle("fov_bias_degrees", "Field of view, bias",
           "predicted minus true vertical field of view.", of="field of view", smallest=-180.0,
           signed=True),
    _angle("ray_error_degrees", "Rays, error",
           "mean angle between the ray of a pixel and the line from the camera to the predicted"
           " point; only for point maps.", of="points"),
    _error("ause_abs_rel", "AUSE of AbsRel",
           "area between two curves over the fraction of removed pixels: AbsRel after removing the"
           " least confident pixels, and AbsRel after removing the pixels with the largest error.",
           "ratio", of="confidence", baselines=(RANDOM_ORDER, EDGE_DISTANCE), **_ANYWHERE),
    _error("aurg_abs_rel", "AURG of AbsRel",
           "area between AbsRel of all pixels and the curve of AbsRel after removing the least"
           " confident pixels; 0 for a random order.", "ratio", of="confidence",
           smallest=-math.inf, higher_is_better=True, **_ANYWHERE),
    _angle("normal_mean_degrees", "Normals, mean",
           "mean angle between predicted and true normals.", **_NORMAL),
    _angle("normal_median_degrees", "Normals, median",
           "median angle between predicted and true normals.", **_NORMAL),
    _angle("normal_rmse_degrees", "Normals, RMS",
           "root mean square angle between predicted and true normals.", is_root=True, **_NORMAL),
    *(_share(f"normal_within_{limit}", f"Normals within {limit}°",
             f"fraction of angles between predicted and true normals below {limit} degrees.",
             **_NORMAL)
      for limit in ("5", "7.5", "11.25", "22.5", "30")),
    _error("shape_error", "Shape error",
           "mean error inside objects, after each object's median error is subtracted.",
           of="points",
           headline={"rooms": 1, "interiors": 6}, printed=8,
           baselines=(*_FLAT_OR_EMPTY, LEANING), **_INSIDE),
    _correlation("shape_correlation", "Shape correlation",
                 "correlation between predicted and true depth inside objects, after the"
                 " least-squares plane of each object is subtracted from both.",
                 lacking="bends", **_SURFACE),
    _share("shape_recall_0.02", "Shapes within 0.02",
           "fraction of objects with a `shape_error` below 0.02 scene units.",
           of="points", **_INSIDE),
    _angle("shape_normal_degrees", "Normals inside objects",
           "mean angle between predicted and true normals inside objects.", of="normals",
           baselines=_FLAT_OR_EMPTY, **_INSIDE),
    _angle("derived_shape_normal_degrees", "Normals inside objects, from points",
           "`shape_normal_degrees` of normals derived from the predicted and from the true points.",
           of="points", baselines=_FLAT_OR_EMPTY, **_INSIDE),
    _error(BEHIND, "Hidden surfaces, depth error",
           "mean error at the pixels of objects that are hidden in the first view of the scene.",
           headline={"rooms": 2}, printed=7,
           baselines=(EMPTY_ROOM, CUT_OUT, LEANING, BALLS, BLOCKS), **_BEHIND),
    _share("behind_recall_0.05", "Hidden surfaces within 0.05",
           "fraction of the hidden true surface that is nearer than 0.05 scene units to a predicted"
           " point.", **_BEHIND),
    _error("object_depth_error", "Objects' depth error",
           "mean absolute difference of predicted and true planar depth, over the pixels of"
           " objects.", baselines=(EMPTY_ROOM,), **_OBJECT),
    _error("object_completeness", "Objects' completeness",
           "mean distance from the true surface of objects to all predicted points.",
           baselines=(EMPTY_ROOM,), **_SURFACE, **_OBJECT),
    *(_share(f"object_recall_{limit}", f"Objects found within {limit}",
             f"fraction of objects whose own `object_completeness` is below {limit} scene"
             " units.", **_SURFACE, **_OBJECT)
      for limit in ("0.02", "0.05")),
    _angle("object_normal_mean_degrees", "Objects' normals, mean",
           "mean angle between predicted and true normals, over the pixels of objects.",
           of="normals", lacking="objects"),
    _angle("derived_object_normal_mean_degrees", "Objects' normals, mean, from points",
           "`object_normal_mean_degrees` of normals derived from the predicted and from the true"
           " points.", lacking="objects", **_SURFACE),
    _correlation("relief_correlation", "Relief correlation",
                 "correlation between predicted and true relief. Relief is the planar depth of the"
                 " empty room minus the planar depth of the surface.", **_RELIEF),
    _share("relief_iou", "Segmentation (relief IoU)",
           "foreground IoU: number of pixels where predicted and true relief both exceed 0.05"
           " scene units, divided by the number of pixels where at least one of them does.",
           headline={"rooms": 3}, printed=6, **_RELIEF),
    _share("solid_iou", "Solid IoU",
           "intersection over union, along the rays, of the predicted and the true spans inside"
           " objects.",
           headline={"layers": 1},
           baselines=(CONSTANT, SIZED, INFLATED, MIRRORED), **_LAYERS),
    _error("back_depth_error", "Back depth error",
           "mean absolute error of the depth at which rays leave the first visible solid.",
           headline={"layers": 2}, **_LAYERS),
    _error("unseen_chamfer", "Chamfer, unseen",
           "Chamfer distance of the surfaces of objects behind the first layer.",
           headline={"layers": 3}, **_LAYERS),
    _error("seen_chamfer", "Chamfer, seen",
           "Chamfer distance of the surfaces of objects in the first layer.", **_LAYERS),
    _share("layer_recall_0.02", "Layer recall",
           "fraction of the true layers of objects, from layer 2 on, whose depth is within 0.02"
           " scene units of the predicted layer with the same number.",
           headline={"layers": 4}, **_LAYERS),
    *(_share(f"layer_{number}_recall_0.02", f"Layer recall, layer {number}",
             f"`layer_recall_0.02` of layer {number}.", **{**_LAYERS, "lacking": lacking})
      for number, lacking in ((2, "solids"), (3, "layer 3"), (4, "layer 4"))),
    _share("hidden_object_recall", "Hidden objects",
           "fraction of hidden objects that are predicted. A hidden object is the first surface on"
           " less than 1% of its rays. A predicted object has, on at least half of its rays, a"
           " predicted span with an IoU above 0.5 with the true span.",
           **{**_LAYERS, "lacking": "hidden objects"}),
    _error("whole_chamfer", "Chamfer, whole surfaces",
           "Chamfer distance between the predicted mesh and the whole true surfaces of objects,"
           " each represented by 4096 points drawn evenly by area.", **_MESHES),
    _share("whole_f_score_0.02", "F-score, whole surfaces",
           "F-score of the points of `whole_chamfer` at 0.02 scene units.", **_MESHES),
    _error("whole_chamfer_noise", "Chamfer, noise level",
           "`whole_chamfer` between two random draws of points of the true surfaces.", **_MESHES),
    _share("iqtt_accuracy", "IQTT accuracy",
           "fraction of questions with a correct response. Abstentions are wrong. Chance is 1"
           " divided by the number of options.",
           of="answers", tasks=("iqtt",), headline={"iqtt": 1}),
)  # fmt: skip


@dataclass(frozen=True)
class Form:
    """Makes a further metric of another one.

    Attributes:
        name: with * for the name of the other.
        title: what follows the title of the other.
        definition: what follows its name.
        changes: attributes that differ from the other's.
    """

    name: str
    title: str
    definition: str
    changes: Mapping[str, Any] = field(default_factory=dict)

    def of(self, metric: Metric) -> Metric:
        """Return the further metric."""
        return replace(
            metric,
            name=self.name.replace("*", metric.name),
            title=f"{metric.title}, {self.title}",
            definition=f"`{metric.name}`: {self.definition}",
            **{"headline": {}, "printed": 0, "baselines": (), "forms": "", **self.changes},
        )


_LEAST_SQUARES = "fitted by least squares to the ground truth of the image."
_FITTED = "after the non-negative scale"
FORMS: Mapping[str, Sequence[Form]] = {
    "": (),
    "depth": (
        Form("*_after_median_scale", "scaled by the median",
             "after scaling the predicted depth to the true median depth of the image."),
        Form("*_after_scale", "scaled", f"{_FITTED} {_LEAST_SQUARES}"),
        Form("*_after_scale_shift", "scaled and shifted", f"{_FITTED} and shift {_LEAST_SQUARES}"),
        Form("*_after_scale_l1", "scaled by L1", f"{_FITTED} that minimises AbsRel of the image."),
        Form("*_after_scale_shift_l1", "scaled and shifted by L1",
             f"{_FITTED} and shift that minimise AbsRel of the image."),
        Form("*_after_disparity_scale_shift", "with disparity scaled and shifted",
             f"{_FITTED} and shift of 1 / depth, {_LEAST_SQUARES[:-1]}; depth is at most the"
             " largest true one."),
    ),
    "points": (
        Form("*_after_scale", "scaled", f"{_FITTED} of points {_LEAST_SQUARES}"),
        Form("*_after_scale_shift", "scaled and shifted",
             f"{_FITTED} and shift in space {_LEAST_SQUARES}"),
    ),
    "normals": (
        Form("derived_*", "from points",
             "of normals derived from the predicted points, against those derived from the true"
             " points.",
             {"of": "points", "lacking": "planes", "redefined": True, "tasks": ("rooms",)}),
    ),
}  # fmt: skip


def _forms(rows: Iterable[Metric]) -> Iterator[Metric]:
    """Yield the rows, and after each family of them its further forms."""
    for forms, family in itertools.groupby(rows, lambda metric: metric.forms):
        members = list(family)
        yield from members
        yield from (form.of(metric) for form in FORMS[forms] for metric in members)


def _scores_of_baselines() -> Iterator[Metric]:
    for begins, baseline in BASELINES.items():
        anywhere = begins in (FLAT, RAMP, RANDOM_ORDER, EDGE_DISTANCE)
        tasks = ("rooms", "measured") if anywhere else ("rooms",)
        changes: dict[str, Any] = {"redefined": False, "tasks": tasks}
        changes |= {"lacking": "partner"} if begins == OTHER_SCENE else {}
        form = Form(f"{begins}*", baseline.name, f"that of {baseline.definition}", changes)
        yield from (form.of(metric) for metric in TABLE if begins in metric.baselines)


ALL: Mapping[str, Metric] = {
    metric.name: metric for metric in (*_forms(TABLE), *_scores_of_baselines())
}
_PLACES = {name: place for place, name in enumerate(ALL)}
HEADLINE: dict[str, tuple[str, ...]] = {
    kind: tuple(
        metric.name
        for metric in sorted(TABLE, key=lambda metric: metric.headline.get(kind, 0))
        if kind in metric.headline
    )
    for kind in KINDS
}
PRINTED = HEADLINE | {
    "rooms": tuple(
        metric.name for metric in sorted(TABLE, key=lambda metric: metric.printed) if metric.printed
    )
}
OBJECT_SCORES = tuple(metric.name for metric in TABLE if metric.of_objects)
SKILLED: Mapping[str, tuple[str, ...]] = {
    metric.name: metric.baselines for metric in TABLE if metric.baselines
}


def unit_in(name: str, length: str) -> str:
    """Return the unit of a score; `length` is that of lengths, "scene unit" or "metre"."""
    return metric(name).unit.replace("scene unit", length)


def metric(name: str) -> Metric:
    """Return the metric of this name; F-scores carry their threshold, such as `f_score_0.05`.

    Raises UnknownMetricError.
    """
    threshold = _threshold(name)
    if threshold is not None:
        return replace(ALL[F_SCORE], name=name, title=f"F-score at {threshold:g}")
    if name not in ALL or name == F_SCORE:
        hint = did_you_mean(name, ALL)
        raise UnknownMetricError(
            "score", f"{name!r:.60}", "a name listed in docs/data/metrics.csv", hint
        )
    return ALL[name]


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


def csv_table() -> str:
    """Return all metrics as docs/data/metrics.csv."""
    rows: list[tuple[str, ...]] = [("name", "of", "unit", "better", "worst", "definition")]
    for forms, family in itertools.groupby(TABLE, lambda metric: metric.forms):
        rows += [(m.name, m.of, m.unit, m.better, f"{m.worst():g}", m.definition) for m in family]
        for form in FORMS[forms]:
            name = form.name.replace("*", f"<{forms.rstrip('s')} metric>")
            of = str(form.changes.get("of", "the same"))
            rows.append((name, of, *["the same"] * 3, f"the metric {form.definition}"))
    for begins, baseline in BASELINES.items():
        names = ", ".join(f"`{m.name}`" for m in TABLE if begins in m.baselines)
        text = f"of {baseline.definition} In `items` only, for {names}."
        rows.append((f"{begins}<metric>", *["the same"] * 4, text))
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows(rows)
    return table.getvalue()


if __name__ == "__main__":
    print(csv_table(), end="")

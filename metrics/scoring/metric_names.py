"""Every score by name: its unit, which way is better, what it is. The one table of all of them."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from scenegen.common.errors import SceneGenError

HEADLINE = {"rooms": ("chamfer", "hausdorff", "mse_depth"), "iqtt": ("iqtt_accuracy",)}
F_SCORE = "f_score_<threshold>"
DERIVED = "derived_"
_ALIGNED = {
    "_after_median_scale": (
        "scaled to the truth's median",
        "the same after the predicted depth was scaled to the true median depth of its image.",
    ),
    "_after_scale": (
        "scaled",
        "the same after the scale, at least 0, that brings the predicted depth of an image nearest"
        " to the true depth in least squares.",
    ),
    "_after_scale_shift": (
        "scaled and shifted",
        "the same after the scale, at least 0, and the shift that bring the predicted depth of an"
        " image nearest to the true depth in least squares.",
    ),
}


class UnknownMetricError(SceneGenError):
    """A name that is no score of this benchmark."""


@dataclass(frozen=True)
class Metric:
    """What a score is.

    Attributes:
        name: its key in score files.
        title: for the head of a table.
        task: "rooms" or "iqtt".
        unit: of its values; "fraction" runs from 0 to 1.
        higher_is_better: which way is better.
        definition: in one sentence, of one image or question.
        largest: no value is above it, and none below 0.
    """

    name: str
    title: str
    task: str
    unit: str
    higher_is_better: bool
    definition: str
    largest: float = math.inf

    @property
    def direction(self) -> str:
        """Which way is better, in words."""
        return "higher is better" if self.higher_is_better else "lower is better"


def _distance(name: str, title: str, definition: str, unit: str = "scene unit") -> Metric:
    return Metric(name, title, "rooms", unit, False, definition)


def _share(name: str, title: str, definition: str, task: str = "rooms") -> Metric:
    return Metric(name, title, task, "fraction", True, definition, 1.0)


def _angle(name: str, title: str, definition: str) -> Metric:
    return Metric(name, title, "rooms", "degree", False, definition, 180.0)


_POINTS = (
    _distance("chamfer", "Chamfer", "`accuracy_distance` + `completeness_distance`; not squared."),
    _distance(
        "accuracy_distance",
        "Accuracy distance",
        "mean distance from the predicted points to the nearest true point.",
    ),
    _distance(
        "completeness_distance",
        "Completeness distance",
        "mean distance from the true points to the nearest predicted point.",
    ),
    _distance(
        "chamfer_squared",
        "Chamfer, squared",
        "mean squared distance from the predicted points to the nearest true point, plus that from"
        " the true points to the nearest predicted point.",
        "scene unit squared",
    ),
    _distance("hausdorff", "Hausdorff", "larger of `hausdorff_forward` and `hausdorff_reverse`."),
    _distance(
        "hausdorff_forward",
        "Hausdorff, forward",
        "largest distance from a predicted point to the nearest true point.",
    ),
    _distance(
        "hausdorff_reverse",
        "Hausdorff, reverse",
        "largest distance from a true point to the nearest predicted point.",
    ),
    _distance(
        "hausdorff_95",
        "Hausdorff, 95%",
        "larger of the 95th percentiles of the nearest distances from predicted to true and from"
        " true to predicted points.",
    ),
    _share(
        F_SCORE,
        "F-score",
        "harmonic mean of the fractions of predicted points nearer than the threshold (scene"
        " units) to a true point, and of true points nearer to a predicted one.",
    ),
)
_DEPTH = (
    _distance(
        "mse_depth",
        "MSE-depth",
        "mean squared difference of predicted and true planar depth.",
        "scene unit squared",
    ),
    _distance("rmse", "RMSE", "square root of `mse_depth` of the image."),
    _distance(
        "abs_rel", "AbsRel", "mean of absolute difference of depth divided by true depth.", "ratio"
    ),
    _distance(
        "silog",
        "SILog",
        "standard deviation of ln predicted - ln true depth, times 100; depths below 0.001 count"
        " as 0.001.",
        "100 ln",
    ),
    *(
        _share(
            f"delta_{power}",
            f"delta {power}",
            "fraction of pixels whose predicted and true depth differ by a factor below"
            f" {'1.25' if power == 1 else f'1.25^{power}'}.",
        )
        for power in (1, 2, 3)
    ),
)
_NORMALS = (
    _angle(
        "normal_mean_degrees", "Normals, mean", "mean angle between predicted and true normals."
    ),
    _angle("normal_median_degrees", "Normals, median", "median of these angles in the image."),
    _angle("normal_rmse_degrees", "Normals, RMS", "root mean square of these angles."),
    *(
        _share(
            f"normal_within_{limit}",
            f"Normals within {limit}°",
            f"fraction of these angles below {limit} degrees.",
        )
        for limit in ("11.25", "22.5", "30")
    ),
)
_ANSWERS = (
    _share(
        "iqtt_accuracy",
        "IQTT accuracy",
        "1 where the right answer is given, else 0, abstentions included; chance is 1/3.",
        "iqtt",
    ),
)


def _aligned(metric: Metric, ending: str) -> Metric:
    how, definition = _ALIGNED[ending]
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
        title=f"{metric.title}, from depth",
        definition=f"`{metric.name}` of normals derived from the predicted depth, against those"
        " derived in the same way from the true depth.",
    )


ALL: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        *_POINTS,
        *_DEPTH,
        *(_aligned(metric, ending) for ending in _ALIGNED for metric in _DEPTH),
        *_NORMALS,
        *(_derived(metric) for metric in _NORMALS),
        *_ANSWERS,
    )
}
_PLACES = {name: place for place, name in enumerate(ALL)}


def metric(name: str) -> Metric:
    """What the score of this name is; F-scores by their threshold, such as `f_score_0.05`.

    Raises UnknownMetricError.
    """
    threshold = _threshold(name)
    if threshold is not None:
        title = f"F-score at {threshold:g}"
        return replace(ALL[F_SCORE], name=name, title=title)
    if name not in ALL or name == F_SCORE:
        raise UnknownMetricError(f"{name!r:.60} is no score: docs/scores.md lists them")
    return ALL[name]


def in_order(names: Iterable[str]) -> list[str]:
    """Names in the order of the table, F-scores by threshold; unknown ones last."""

    def place(name: str) -> tuple[int, float, str]:
        threshold = _threshold(name)
        if threshold is not None:
            return _PLACES[F_SCORE], threshold, name
        return _PLACES.get(name, len(_PLACES)), 0.0, name

    return sorted(names, key=place)


def _threshold(name: str) -> float | None:
    """The threshold of an F-score in its only spelling, that of `:g`."""
    match = re.fullmatch(r"f_score_([0-9][0-9.e+-]{0,15})", name)
    try:
        threshold = float(match[1]) if match else 0.0
    except ValueError:
        return None
    known = match and 0.0 < threshold < math.inf and f"{threshold:g}" == match[1]
    return threshold if known else None


def markdown_table() -> str:
    """All scores as a Markdown table: that of docs/scores.md."""
    forms = [
        (f"<depth score>{ending}", "as it", "as it", definition)
        for ending, (_, definition) in _ALIGNED.items()
    ]
    derived = "the same of normals derived from the predicted and from the true depth."
    rows = [
        *map(_cells, (*_POINTS, *_DEPTH)),
        *forms,
        *map(_cells, _NORMALS),
        (f"{DERIVED}<normal score>", "as it", "as it", derived),
        *map(_cells, _ANSWERS),
    ]
    lines = [f"| `{name}` | {' | '.join(cells)} |" for name, *cells in rows]
    return "\n".join(["| name | unit | better | definition |", "| --- | --- | --- | --- |", *lines])


def _cells(m: Metric) -> tuple[str, str, str, str]:
    return m.name, m.unit, "higher" if m.higher_is_better else "lower", m.definition

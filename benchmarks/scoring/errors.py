"""What each metric sees: ground truth of interiors, degraded in twelve ways of growing size.

Writes `docs/data/what-each-metric-sees.csv` and `docs/images/what-each-metric-sees.png`, and prints
where a metric is not monotone in what it is for.

    python -m benchmarks.scoring.errors
"""

import csv
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from metrics.measures.pairs import spread
from metrics.scoring.images.image_scores import reference_of, score_prediction
from metrics.scoring.metric_names import metric
from metrics.submissions.reader import PredictedView
from metrics.submissions.truths import read_true_view
from scenegen.description.presets import preset_spec
from scenegen.objects.sources import object_source
from scenegen.rooms.make import make_dataset
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
DOCS = Path(__file__).parents[2] / "docs"
ROOMS, SIZE, SEED = 24, 96, 71
SIZES = np.arange(1, 6) / 5.0
METRICS = (
    *("abs_rel", "delta_1", "delta_1.03", "silog", "scale_log2", "points_rel", "boundary_f1"),
    *("flying_points", "relative_normal_degrees", "ordinal_accuracy", "shape_error", "sawa_h"),
)
# Of each metric, the errors that it is there to see.
FOR = {
    "abs_rel": ("scale", "smooth", "bias"), "delta_1": ("scale",), "delta_1.03": ("smooth",),
    "silog": ("smooth", "bias"), "scale_log2": ("scale",), "points_rel": ("scale", "smooth"),
    "boundary_f1": ("blur", "moved"), "flying_points": ("blur", "flying"),
    "relative_normal_degrees": ("bumps", "noise"), "ordinal_accuracy": ("smooth", "flat"),
    "shape_error": ("smooth", "flat", "bumps"), "sawa_h": ("bumps", "noise", "smooth"),
}  # fmt: skip


def _waves(shape: tuple[int, ...], width: float) -> Array:
    """Return smooth noise of standard deviation 1, the same on every machine."""
    noise = gaussian_filter(spread(int(np.prod(shape)), 1, 0)[:, 0].reshape(shape) - 0.5, width)
    return np.asarray((noise - noise.mean()) / noise.std())


def _sampled(depth: Array, rows: Array, columns: Array) -> Array:
    return np.asarray(map_coordinates(depth, [rows, columns], order=1, mode="nearest"))


def _moved(depth: Array, pixels: float) -> Array:
    rows, columns = np.indices(depth.shape)
    return _sampled(depth, rows, columns - pixels)


def _flying(depth: Array, share: float) -> Array:
    """Put a share of the pixels at edges into the middle between the two surfaces."""
    blurred = gaussian_filter(depth, 1.0)
    chosen = spread(depth.size, 1, 1)[:, 0].reshape(depth.shape) < share
    edge = np.abs(blurred - depth) > 0.02 * depth
    return np.where(edge & chosen, blurred, depth)


def _flat(view: Any, part: float) -> Array:
    """Bring each object nearer to the plane of its median depth."""
    depth = view.depth.astype(np.float64).copy()
    for number in np.unique(view.object_id[view.object_id > 0]).tolist():
        own = view.object_id == number
        depth[own] += part * (np.median(depth[own]) - depth[own])
    return depth


ERRORS: dict[str, Callable[[Any, Array, float], Array]] = {
    "bias": lambda v, d, x: d + 0.5 * x,
    "scale": lambda v, d, x: d * (1.0 + 0.5 * x),
    "smooth": lambda v, d, x: d * np.exp(0.1 * x * _waves(d.shape, 12.0)),
    "bumps": lambda v, d, x: d * np.exp(0.01 * x * _waves(d.shape, 2.0)),
    "noise": lambda v, d, x: d * np.exp(0.02 * x * _waves(d.shape, 0.01)),
    "blur": lambda v, d, x: gaussian_filter(d, 1.5 * x),
    "steps": lambda v, d, x: np.exp(np.round(np.log(d) / (0.1 * x)) * 0.1 * x),
    "flying": lambda v, d, x: _flying(d, x),
    "moved": lambda v, d, x: _moved(d, 4.0 * x),
    "tilt": lambda v, d, x: d * (1.0 + 0.4 * x * (np.indices(d.shape)[1] / d.shape[1] - 0.5)),
    "flat": lambda v, d, x: _flat(v, x),
    "flip": lambda v, d, x: (1.0 - x) * d + x * d[:, ::-1],
}


def measured(rooms: RoomsFile) -> dict[tuple[str, float], dict[str, float]]:
    """Return the mean scores of each error at each size; those of the truth at size 0."""
    found: dict[tuple[str, float], list[dict[str, float]]] = {}
    for row in range(len(rooms)):
        view = read_true_view(rooms, row)
        reference = reference_of(view, None, row, {})
        far = float(view.depth[view.mask].max())
        depth = np.where(view.mask, view.depth, far).astype(np.float64)
        for kind, spoil in ERRORS.items():
            for size in (0.0, *SIZES.tolist()):
                spoilt = spoil(view, depth, size) if size else depth
                spoilt = np.where(np.isfinite(spoilt), spoilt, far).astype(np.float32)
                predicted = PredictedView("depth", "none", spoilt.astype(np.float64))
                scores = score_prediction(predicted, view, reference).scores
                found.setdefault((kind, size), []).append({n: scores[n] for n in METRICS})
    return {
        key: {name: float(np.nanmean([row[name] for row in rows])) for name in METRICS}
        for key, rows in found.items()
    }


def draw(path: Path, means: dict[tuple[str, float], dict[str, float]]) -> None:
    """Draw a panel for each metric, with a line for each kind of error."""
    figure = Figure(figsize=(11, 7.2), layout="constrained")
    styles = ["-", "--", ":"]
    for k, name in enumerate(METRICS):
        axes = figure.add_subplot(3, 4, k + 1)
        apart = {
            kind: [abs(means[kind, s][name] - means[kind, 0.0][name]) for s in (0.0, *SIZES)]
            for kind in ERRORS
        }
        most = max(map(max, apart.values())) or 1.0
        for i, (kind, values) in enumerate(apart.items()):
            axes.plot(
                (0.0, *SIZES), np.array(values) / most, styles[i // 4], color=f"C{i % 4}",
                linewidth=2.4 if kind in FOR[name] else 0.9, label=kind,
            )  # fmt: skip
        axes.set_title(metric(name).title, fontsize=9)
        axes.set(xticks=[0, 1], yticks=[0, 1])
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=12, fontsize=8
    )
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measure, write, draw, and say where a metric is not monotone."""
    source = object_source("interiors")
    settings = {"height": SIZE, "width": SIZE, "seed": SEED, "spp": 1, "denoise": False}
    spec = preset_spec("interiors", **settings, **source.settings)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rooms.h5"
        make_dataset(path, spec, ROOMS, command="benchmarks.scoring.errors", objects=source.objects)
        with RoomsFile(path) as rooms:
            means = measured(rooms)
    with (DOCS / "data" / "what-each-metric-sees.csv").open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(("error", "size", *METRICS))
        out.writerows(
            (kind, size, *(f"{scores[name]:.6g}" for name in METRICS))
            for (kind, size), scores in means.items()
        )
    draw(DOCS / "images" / "what-each-metric-sees.png", means)
    for name, kinds in FOR.items():
        for kind in kinds:
            values = [means[kind, s][name] for s in (0.0, *SIZES)]
            if not (np.diff(values) >= 0).all() and not (np.diff(values) <= 0).all():
                print(f"{name} is not monotone in {kind}: {values}", file=sys.stderr)


if __name__ == "__main__":
    main()

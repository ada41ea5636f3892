"""Figures of papers and pages: scores with intervals, scores by group, and a grid of pictures.

Vector files embed their fonts (TrueType in PDF, outlines in SVG). The same numbers give the same
bytes.
"""

import base64
import io
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.reader import Images, MeasuredFile, open_images
from metrics.measures.confidence import REMOVED
from metrics.measures.statistics import cluster_means
from metrics.scoring.images.geometry import depth_as_scored
from metrics.scoring.images.measured_rows import depth_as_declared
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import Score, ScoreFile
from metrics.submissions.reader import PredictedView, RoomPredictions, open_predictions
from scenegen.common.errors import SceneGenError
from scenegen.common.names import did_you_mean
from scenegen.common.text_table import by_number, number, plain
from scenegen.files.new_file import written_beside
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import radiance_of

Array = NDArray[Any]
Line = tuple[Array, Array, Sequence[Array]]  # of a grid: picture, true depth, depths
Target = str | Path | io.BytesIO  # a file, or a stream that an SVG is written to
COLUMN, PAGE = 3.25, 6.75  # inches: a column, and both, of two-column papers
SUFFIXES = (".pdf", ".svg", ".png")
BINS = 30
# Colour and marker of methods, which may share them, and the colour of baselines.
LOOKS = (
    ("#0b63b0", "o"), ("#b34700", "s"), ("#00735a", "^"), ("#8a3b8f", "D"), ("#7a5c00", "v"),
    ("#4a4f57", "P"),
)  # fmt: skip
BASELINE = "#6b7280"
# The groupings that a figure can show, by task.
GROUPINGS = {
    "angle": {"rooms": "by_view_angle", "iqtt": "by_rotation_angle"},
    "kind": {"rooms": "by_object_shape", "iqtt": "by_distractor"},
    "size": {"rooms": "by_object_size"},
}
_STYLE: dict[Any, Any] = {
    "font.size": 7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "pix2shape-bench",
    "savefig.dpi": 300,
    "text.parse_math": False,
}


class FigureError(SceneGenError):
    """A figure that these files cannot give."""


def draw_scores(
    path: Target,
    files: Sequence[ScoreFile],
    name: str = "",
    width: float = COLUMN,
    overwrite: bool = False,
    labels: Sequence[str] = (),
) -> None:
    """Draw one score of several methods: a dot and an interval each, and the baseline, dashed.

    Args:
        path: to write; its suffix is one of SUFFIXES.
        name: of the score; by default the first one of the headline that all files have.
        width: inches.
        labels: of the files; by default the names of their methods.

    Raises FigureError where the files are of two tasks, or one lacks the score; OSError.
    """
    name = _common(files, name)
    floor = _floor(files[0], name)
    with _figure(path, overwrite, width, 0.6 + 0.17 * len(files)) as axes:
        named = zip(files, labels or labels_of(files), strict=True)
        for place, (file, label) in enumerate(named):
            color, marker = LOOKS[place % len(LOOKS)]
            _dot(axes, file.metrics[name], len(files) - place, color, marker, along="y")
            axes.text(-0.02, len(files) - place, label, ha="right", va="center",
                      transform=axes.get_yaxis_transform())  # fmt: skip
        if floor is not None:
            axes.axvline(floor, color=BASELINE, linestyle="--", label="baseline")
            _legend(axes)
        axes.set(yticks=[], ylim=(0.4, len(files) + 0.6), xlabel=_with_direction(name))
        axes.spines["left"].set_visible(False)


def draw_groups(
    path: Target,
    files: Sequence[ScoreFile],
    by: str = "angle",
    name: str = "",
    width: float = COLUMN,
    overwrite: bool = False,
) -> None:
    """Draw one score by group: by angle, kind or size, as GROUPINGS has them; baselines are dashed.

    Args and errors as of `draw_scores`; FigureError, too, where the files have no such groups.
    """
    name = _common(files, name)
    grouping = GROUPINGS[by].get(files[0].task)
    groups = [getattr(file, grouping) if grouping else {} for file in files]
    keys = [key for key in groups[0] if all(name in group.get(key, {}) for group in groups)]
    if not keys:
        place = f"{files[0].method}: {name} by {by}"
        raise FigureError(place, "no groups that all files have", "another --by or --metric")
    keys = by_number(keys)
    floors = [_group_floor(files[0], by, key, name) for key in keys]
    with _figure(path, overwrite, width, 0.62 * width) as axes:
        for i, (group, label) in enumerate(zip(groups, labels_of(files), strict=True)):
            color, marker = LOOKS[i % len(LOOKS)]
            aside = 0.12 * (i - (len(files) - 1) / 2)
            for at, key in enumerate(keys):
                _dot(axes, group[key][name], at + aside, color, marker, along="x")
            values = [group[key][name].value for key in keys]
            if by == "angle":
                axes.plot(np.arange(len(keys)) + aside, values, color=color, alpha=0.5)
            axes.plot([], [], marker, color=color, markersize=3, label=label)
        for at, floor in enumerate(floors):
            if floor is not None:
                label = "baseline" if at == 0 else "_"
                axes.hlines(floor, at - 0.4, at + 0.4, BASELINE, "--", label=label)
        axes.set_xticks(range(len(keys)), keys, rotation=0 if by == "angle" else 20)
        axes.set(xlabel=_words(by, files[0].task), ylabel=_with_direction(name, "\n"))
        _legend(axes)


def draw_histogram(path: Target, file: ScoreFile, name: str, width: float = COLUMN) -> None:
    """Draw the distribution of a score over the items, with mean and median."""
    values = np.asarray(file.items[name], float)
    values = values[np.isfinite(values)]
    limits = (min(0.0, float(values.min())), max(0.0, float(values.max())))
    counts, edges = np.histogram(values, BINS, limits)
    middles = (("mean", float(values.mean()), "-"), ("median", float(np.median(values)), "--"))
    with _figure(path, False, width, 0.55 * width) as axes:
        axes.stairs(counts, edges, fill=True, color="#5b8fbf")
        for (text, at, style), (color, _) in zip(middles, LOOKS[1:], strict=False):
            axes.axvline(at, color=color, linestyle=style, label=f"{text} {number(at)}")
        axes.set(xlabel=file.unit_of(name), ylabel="images")
        axes.locator_params(axis="x", nbins=6)
        _legend(axes)


def draw_sparsification(path: Target, curves: Array, width: float = COLUMN) -> None:
    """Draw mean errors, (3, 20), without the least sure pixels: method, random order, oracle."""
    names = ("method", "random order", "oracle")
    with _figure(path, False, width, 0.7 * width) as axes:
        for curve, name, (color, _) in zip(curves, names, LOOKS[1:], strict=False):
            axes.plot(100.0 * REMOVED, curve, color=color, label=name)
        axes.set(xlabel="removed pixels (%), least confident first", ylabel="AbsRel of the rest")
        axes.set_ylim(bottom=0.0)
        _legend(axes)


def svg_url(draw: Callable[..., None], *arguments: Any) -> str:
    """Return what one of these functions draws, as SVG in a data URL."""
    stream = io.BytesIO()
    draw(stream, *arguments)
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()


def draw_grid(
    path: Target,
    truth: str | Path,
    submissions: Sequence[str | Path],
    rows: Sequence[int],
    width: float = PAGE,
    overwrite: bool = False,
) -> None:
    """Draw rows of a truth: image, true depth, then depth and error of each submission.

    All depths share the range of the true ones. Errors are shown from none to a tenth of that
    range, or more. Depth known up to a scale or shift is aligned as it is for its scores.

    Raises FigureError where a row is not there, or a submission answers questions; OSError;
    FileFormatError for damaged files.
    """
    opened = [open_predictions(path) for path in submissions]
    try:
        with open_images(truth) as rooms:
            lines = []
            for row in rows:
                if not 0 <= row < len(rooms):
                    raise FigureError(
                        f"{truth}: row {row}", "no such image", f"0 to {len(rooms) - 1}"
                    )
                lines.append(shown_row(rooms, row, [_view(file, row) for file in opened]))
    finally:
        for file in opened:
            file.close()
    _grid(path, lines, [file.method for file in opened], width, overwrite)


def labels_of(files: Sequence[ScoreFile]) -> list[str]:
    """Return the methods' names, cut where they are long; a number follows those that repeat."""
    names = [plain(file.method) for file in files]
    names = [name if len(name) <= 24 else f"{name[:23]}…" for name in names]
    return [
        f"{name} ({names[: i + 1].count(name)})" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]


def shown_row(rooms: Images, row: int, views: Sequence[PredictedView]) -> Line:
    """Return image (H, W, 3), sRGB bytes, true depth (H, W), and depths as scored, of a row."""
    if isinstance(rooms, MeasuredFile):
        truth = rooms.view(row)
        depths = [depth_as_declared(view, truth) for view in views]
        return rooms.picture(row), truth.depth.astype(np.float64), depths
    true = rooms.read("depth", row).astype(np.float64)
    picture = srgb_bytes(np.nan_to_num(radiance_of(rooms, row)))
    return picture, true, [depth_as_scored(view, true, rooms.lens(row)) for view in views]


def _view(file: Any, row: int) -> PredictedView:
    if not isinstance(file, RoomPredictions):
        raise FigureError(file.path, "responses to questions", "predictions of rooms")
    places = np.flatnonzero(file.rows == row)
    if not len(places):
        raise FigureError(f"{file.path}: row {row}", "no prediction", "one of this image")
    return file.view(int(places[0]))


def _grid(
    path: Target,
    lines: Sequence[Line],
    methods: Sequence[str],
    width: float,
    overwrite: bool,
) -> None:
    columns = 2 + 2 * len(methods)
    titles = ["image", "true depth", *(text for m in methods for text in (m, "error"))]
    tall, wide = lines[0][1].shape
    height = width / columns * tall / wide * len(lines) + 0.55
    known = np.concatenate([true[np.isfinite(true)] for _, true, _ in lines])
    near, far = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    span = max(far - near, 1e-9)
    with _figure(path, overwrite, width, height, (len(lines), columns)) as table:
        for line, (picture, true, depths) in enumerate(lines):
            axes_of_row = table[line]
            seen = np.isfinite(true)
            axes_of_row[0].imshow(picture, interpolation="nearest")
            shades = [np.where(seen, true, np.nan)]
            for depth in depths:
                shades += [np.where(seen, depth, np.nan), np.abs(depth - true)]
            for place, shade in enumerate(shades):
                is_error = place > 0 and place % 2 == 0
                limits = (0.0, 0.1 * span) if is_error else (near, far)
                drawn = axes_of_row[1 + place].imshow(
                    shade, "inferno" if is_error else "viridis", vmin=limits[0], vmax=limits[1],
                    interpolation="nearest",
                )  # fmt: skip
                if line == len(lines) - 1 and place in (0, 2):
                    bar = drawn.figure.colorbar(
                        drawn, ax=list(table[:, 1 + place]), location="bottom", shrink=0.9,
                        aspect=12,
                    )  # fmt: skip
                    bar.ax.tick_params(labelsize=5)
        for axes, title in zip(table[0], titles, strict=True):
            axes.set_title(title[:18], fontsize=6)
        for axes in table.flat:
            axes.set_axis_off()


def _common(files: Sequence[ScoreFile], name: str) -> str:
    """Return the score that is drawn. Raises FigureError."""
    tasks = {file.task for file in files}
    if len(tasks) > 1:
        raise FigureError(files[-1].place, "scores of rooms and of questions", "files of one task")
    names = [name] if name else HEADLINE[files[0].kind]
    for candidate in names:
        if all(candidate in file.metrics for file in files):
            return candidate
    lacking = next(file for file in files if not set(names) <= file.metrics.keys())
    asked = name or names[0]
    hint = did_you_mean(asked, lacking.metrics)
    raise FigureError(
        lacking.place, f"no metric {asked}", "one that `bench score --all` prints", hint
    )


def _floor(file: ScoreFile, name: str) -> float | None:
    return file.skills[name].floor if name in file.skills else None


def _group_floor(file: ScoreFile, by: str, key: str, name: str) -> float | None:
    if file.task == "iqtt":
        floor = file.question_floors.get(key) if by == "kind" else None
        return None if floor is None else floor.accuracy
    return angle_floor(file, key, name) if by == "angle" else None


def angle_floor(file: ScoreFile, degrees: str, name: str) -> float | None:
    """Return the mean of a score's baseline over the views turned by so many degrees."""
    angles = file.items.get("view_angle_degrees")
    column = file.items.get(f"{file.floor_of(name)}{name}")
    if angles is None or column is None:
        return None
    chosen = (np.abs(angles) == int(degrees)) & np.isfinite(column)
    if not chosen.any():
        return None
    return float(cluster_means(column[chosen], file.clusters[chosen]).mean())


def _dot(axes: Any, score: Score, at: float, color: str, marker: str, along: str) -> None:
    place = (score.value, at) if along == "y" else (at, score.value)
    axes.plot(*place, marker, color=color, markersize=3)
    if score.low is not None and score.high is not None:
        draw = axes.hlines if along == "y" else axes.vlines
        draw(at, score.low, score.high, color=color)


def _with_direction(name: str, between: str = " ") -> str:
    about = metric(name)
    unit = "" if about.unit in ("1", "fraction") else f"{about.unit},{between}"
    better = "higher" if about.higher_is_better else "lower"
    return f"{about.title}{between}({unit}{better} is better)"


def _legend(axes: Any) -> None:
    axes.figure.legend(loc="outside upper left", ncols=3, frameon=False)


def _words(by: str, task: str) -> str:
    if by == "angle":
        what = "angle to the first view (degrees)" if task == "rooms" else "rotation (degrees)"
    else:
        what = {"kind": "shape" if task == "rooms" else "distractor type"}.get(by, "")
        what = what or "area in the image (percent)"
    return what


def load_matplotlib() -> Any:
    """Return matplotlib. A backend in the environment does not count: none is used here.

    Notebooks and IDEs leave MPLBACKEND behind, and a name that matplotlib does not know would end
    its import.
    """
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        import matplotlib
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    return matplotlib


@contextmanager
def _figure(
    path: Target,
    overwrite: bool,
    width: float,
    height: float,
    table: tuple[int, int] | None = None,
) -> Iterator[Any]:
    """Give axes, or a table of them, of a figure that is written when the block ends well."""
    matplotlib = load_matplotlib()
    from matplotlib.figure import Figure

    suffix = ".svg" if isinstance(path, io.BytesIO) else Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FigureError(path, f"the ending {suffix!r}", " or ".join(SUFFIXES))
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure.add_subplot() if table is None else figure.subplots(*table, squeeze=False)
        stream = io.BytesIO()
        metadata: Mapping[str, Any] = {
            ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
            ".svg": {"Date": None, "Creator": None},
            ".png": {"Software": None},
        }[suffix]
        with warnings.catch_warnings():  # names may have letters that the font lacks
            warnings.simplefilter("ignore", UserWarning)
            figure.savefig(stream, format=suffix[1:], metadata=dict(metadata))
    if isinstance(path, io.BytesIO):
        path.write(stream.getvalue())
        return
    with written_beside(path, overwrite) as temporary:
        temporary.write_bytes(stream.getvalue())

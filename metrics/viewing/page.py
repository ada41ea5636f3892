"""The page of predictions: predicted surfels beside the true ones, the worst scenes first."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.normals import angular_errors_degrees
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.submissions.reader import RoomPredictions
from metrics.viewing.colors import error_colors, legend
from metrics.viewing.order import RowScores, sortable, worst_first
from scenegen.camera import transform_vectors
from scenegen.rooms.preview import normal_bytes
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.viewing.contents import (
    Cloud,
    Contents,
    Place,
    about_scene,
    object_name,
    paragraph,
    scene_rows,
    start_at_view,
    table,
    truth_cloud,
    view_label,
)
from scenegen.viewing.geometry import ShapeOf, Surfels, has_surfel, pixel_colors, surfels_of
from scenegen.viewing.page import ScenePage

if TYPE_CHECKING:
    from viser import ViserServer

Array = NDArray[Any]
BESIDE, SAME, ALONE = "Beside the truth", "In the place of the truth", "Without the truth"
ERROR, NORMAL, TRUTHS = "Error of depth", "Predicted normal", "As the true surfels"
SHOWN_SCORES = ("relief_iou", "chamfer", "hausdorff", "rmse", "normal_mean_degrees")
GAP = 1.1  # between true and predicted surfels, in widths of the image
BACK = 2.2  # how many times farther than the view's camera both are looked at from
UNITS = {  # as words behind a number; other units stand as they are
    "fraction": "",
    "correlation": "",
    "ratio": "",
    "degree": "degrees",
    "scene unit": "scene units",
    "scene unit squared": "scene units squared",
}


class PredictionPage:
    """The page on a running server.

    Args:
        server: from `scenegen.viewing.server.started`.
        rooms: the truth.
        predictions: of the rows of `scores`, or more.
        scores: rows to show, and what to sort them by.
        shape_of: from `scenegen.viewing.geometry.shapes_of`.

    Attributes:
        page: it is drawn on.
    """

    def __init__(
        self,
        server: "ViserServer",
        rooms: RoomsFile,
        predictions: RoomPredictions,
        scores: RowScores,
        shape_of: ShapeOf,
    ) -> None:
        self._predictions, self._scores = predictions, scores
        self._entries = {row: i for i, row in enumerate(predictions.rows.tolist())}
        self._scenes = scene_rows(rooms, sorted(scores.rows.tolist()))
        self._names = sortable(scores)
        gui = server.gui
        names = HEADLINE["rooms"]
        first = next((title for title, name in self._names.items() if name in names), None)
        self._sort: Any = gui.add_dropdown("Sort by", list(self._names), initial_value=first)
        contents = Contents(
            self._order, view_label, self._clouds, self._about, self._start,
            "Scene, 0 is the worst", cameras=False,
        )  # fmt: skip
        self.page = ScenePage(server, rooms, shape_of, contents)
        with gui.add_folder("Predicted surfels"):
            self._where = self.page.add("place", gui.add_dropdown("Place", (BESIDE, SAME, ALONE)))
            colorings = (ERROR, *([NORMAL] if predictions.has_normals else []), TRUTHS)
            self._colored = self.page.add("error", gui.add_dropdown("Colour", colorings))
            full = gui.add_number(
                "Full colour at", 0.05, min=0.001, max=10.0, step=0.001,
                hint="Error of depth, in scene units, that has the full colour.",
            )  # fmt: skip
            self._full = self.page.add("full", full)
            self._legend = gui.add_html("")
        self._sort.on_update(lambda _: self.page.restart())
        self.page.add("sort", self._sort)
        self.page.show()

    def _order(self) -> list[tuple[int, ...]]:
        return worst_first(self._scores, self._names[self._sort.value], self._scenes)

    def _clouds(self, shown: Sequence[Room], coloring: str) -> list[Cloud]:
        self._legend.content = legend(self._full.value)
        self._legend.visible = self._colored.value == ERROR
        clouds = list[Cloud]()
        for room in shown:
            depth, normal = self._predicted(room)
            truth = truth_cloud(room, coloring, lambda i: "")
            camera = room.world_from_camera
            predicted = surfels_of(depth, room.fov_y_degrees, camera)
            shift = aside(room) if self._where.value == BESIDE else np.zeros(3)
            predicted = predicted.moved(shift)
            tells = [_teller(room, depth, normal, one) for one in (truth.surfels, predicted)]
            colors = self._colors(room, depth, normal, predicted, coloring)
            name = f"/prediction/{room.index}"
            partners = _points_of(truth.surfels, predicted, room.depth.shape)
            clouds.append(Cloud(name, predicted, colors, tells[1], partners))
            if self._where.value != ALONE:
                partners = _points_of(predicted, truth.surfels, room.depth.shape)
                args = truth.name, truth.surfels, truth.colors, tells[0], partners
                clouds.append(Cloud(*args))
        return clouds

    def _predicted(self, room: Room) -> tuple[Array, Array | None]:
        i = self._entries[room.index]
        has_normals = self._predictions.has_normals
        return self._predictions.depth(i), self._predictions.normal(i) if has_normals else None

    def _colors(
        self, room: Room, depth: Array, normal: Array | None, surfels: Surfels, coloring: str
    ) -> Array:
        if self._colored.value == NORMAL and normal is not None:
            length = np.linalg.norm(normal, axis=-1, keepdims=True)
            unit = np.nan_to_num(normal / np.where(length > 0, length, 1.0))
            world = transform_vectors(room.world_from_camera, unit)
            return surfels.of_pixels(normal_bytes(world))
        if self._colored.value == TRUTHS:
            return surfels.of_pixels(pixel_colors(room, coloring))
        return error_colors(surfels.of_pixels(depth - room.depth), self._full.value)

    def _about(self, shown: Sequence[Room]) -> str:
        text = about_scene(shown)
        for room in shown:
            found = self._scores.of(room.index)
            chosen = self._names[self._sort.value]
            names = dict.fromkeys((chosen, *SHOWN_SCORES))
            values = {metric(n).title: _score(n, found[n]) for n in names if n in found}
            depth, _ = self._predicted(room)
            absent = depth.size - np.count_nonzero(has_surfel(depth))
            if absent:
                values["Not shown"] = f"{absent} pixels whose depth is no place in view"
            text += paragraph(view_label(room)) + table(**values)
        return text

    def _start(self, room: Room) -> Place:
        position, target = start_at_view(room)
        if self._where.value != BESIDE:
            return position, target
        middle = target + aside(room) / 2
        return middle + BACK * (position - target), middle


def aside(room: Room) -> Array:
    """Return by how much a prediction is moved to the right of a view to be beside the truth, (3,).

    World frame, scene units: a little more than the width of what the view shows.
    """
    points = surfels_of(room.depth, room.fov_y_degrees, room.world_from_camera).points
    right = room.world_from_camera[:3, 0]
    across = points @ right
    width = float(np.ptp(across)) if len(across) else 1.0
    return np.asarray(GAP * width * right)


def _points_of(of: Surfels, like: Surfels, shape: tuple[int, ...]) -> Array:
    """Return the points of the pixels that `like` has, (N, 3); NaN where there is none."""
    points = np.full((*shape, 3), np.nan, np.float32)
    points[of.pixels[:, 0], of.pixels[:, 1]] = of.points
    return like.of_pixels(points)


def _teller(room: Room, depth: Array, normal: Array | None, surfels: Surfels) -> Any:
    """Return the function that says what is known of the i-th surfel."""

    def tell(i: int) -> str:
        y, x = surfels.pixels[i]
        true, predicted = float(room.depth[y, x]), float(depth[y, x])
        lines = {
            "view": view_label(room),
            "pixel": f"row {y}, column {x}",
            "true depth": f"{true:.5f}",
            "predicted depth": f"{predicted:.5f}",
            "difference": f"{predicted - true:+.5f}",
            "object": object_name(room, int(room.object_id[y, x])),
        }
        if normal is not None and np.isfinite(normal[y, x]).all() and normal[y, x].any():
            (angle,) = angular_errors_degrees(normal[y, x : x + 1], room.normal[y, x : x + 1])
            lines["angle of normals"] = f"{angle:.1f}°"
        return table(**lines)

    return tell


def _score(name: str, value: float) -> str:
    if not np.isfinite(value):
        return "none"
    unit = metric(name).unit
    return f"{value:.4g} {UNITS.get(unit, unit)}".rstrip()

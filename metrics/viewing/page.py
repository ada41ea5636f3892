"""The page of predictions: predicted surfels beside the true ones, the worst scenes first."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.normals import angular_errors_degrees
from metrics.scoring.geometry import points_as_scored
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.submissions.reader import RoomPredictions
from metrics.viewing.order import RowScores, sortable, worst_first
from scenegen.camera import transform_vectors
from scenegen.rooms.preview import normal_bytes
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.viewing.drawing import Look
from scenegen.viewing.geometry import ShapeOf, Surfels, has_surfel, pixel_colors, surfels_of
from scenegen.viewing.page import (
    LAYERS,
    Cloud,
    ScenePage,
    paragraph,
    scene_rows,
    table,
    view_label,
)

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
TOO_NEAR, RIGHT, TOO_FAR = (0, 80, 200), (222, 222, 222), (200, 30, 0)
UNKNOWN = (120, 0, 140)  # the truth has no depth there


class PredictionPage(ScenePage):
    """The page on a running server.

    Args:
        server: from `scenegen.viewing.server.started`.
        rooms: the truth.
        predictions: of the rows of `scores`, or more.
        scores: rows to show, and what to sort them by.
        shape_of: from `scenegen.viewing.geometry.shapes_of`.
    """

    scene_label = "Scene, 0 is the worst"
    layers = LAYERS | {"cameras": ("Cameras", False)}

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
        self._names = sortable(scores)
        self._by_file = scene_rows(rooms, scores.rows.tolist())
        gui, names = server.gui, HEADLINE["rooms"]
        first = next((title for title, name in self._names.items() if name in names), None)
        sort = gui.add_dropdown("Sort by", list(self._names), initial_value=first)
        by_score = worst_first(scores, self._names[sort.value], self._by_file)
        super().__init__(server, rooms, shape_of, by_score)
        with gui.add_folder("Predicted surfels"):
            self.add("place", gui.add_dropdown("Place", (BESIDE, SAME, ALONE)))
            colorings = (ERROR, *([NORMAL] if predictions.has_normals else []), TRUTHS)
            self.add("error", gui.add_dropdown("Colour", colorings))
            hint = "Error of depth, in scene units, that has the full colour."
            full = gui.add_number("Full colour at", 0.05, min=0.001, max=10, step=0.001, hint=hint)
            self.add("full", full)
            self._legend = gui.add_html("")
        self.controls["sort"] = sort
        sort.on_update(lambda _: self._sort())
        self.show()

    def _sort(self) -> None:
        """Put the scenes in the order of the chosen score, and go to the first one."""
        name = self._names[self.controls["sort"].value]
        self.scenes = worst_first(self._scores, name, self._by_file)
        self.controls["scene"].value = 0
        self.show()

    def make_clouds(self, shown: Sequence[Room]) -> list[Cloud]:
        """Return the predicted surfels of these views, and the true ones."""
        full, place = self.controls["full"].value, self.controls["place"].value
        self._legend.content = legend(full)
        self._legend.visible = self.controls["error"].value == ERROR
        clouds = list[Cloud]()
        for room in shown:
            points = self._points(room)
            depth, surfels = -points[..., 2], surfels_of(room, points)
            surfels = surfels.moved(aside(room)) if place == BESIDE else surfels
            colors = self._colors(room, depth, surfels)
            clouds.append(Cloud(f"/prediction/{room.index}", room, surfels, colors))
            clouds += [] if place == ALONE else [self.truth_cloud(room)]
        return clouds

    def _points(self, room: Room) -> Array:
        predicted = self._predictions.view(self._entries[room.index])
        return points_as_scored(predicted, room.depth, room.fov_y_degrees)

    def _normal(self, room: Room) -> Array | None:
        if not self._predictions.has_normals:
            return None
        return self._predictions.normal(self._entries[room.index])

    def _colors(self, room: Room, depth: Array, surfels: Surfels) -> Array:
        coloring, normal = self.controls["error"].value, self._normal(room)
        if coloring == NORMAL and normal is not None:
            length = np.linalg.norm(normal, axis=-1, keepdims=True)
            unit = np.nan_to_num(normal / np.where(length > 0, length, 1.0))
            return surfels.of_pixels(normal_bytes(transform_vectors(room.world_from_camera, unit)))
        if coloring == TRUTHS:
            return surfels.of_pixels(pixel_colors(room, self.controls["colour"].value))
        return error_colors(surfels.of_pixels(depth - room.depth), self.controls["full"].value)

    def describe(self, shown: Sequence[Room]) -> str:
        """Return what to say of these views, as HTML: the scene, and the scores of each."""
        text = super().describe(shown)
        chosen = self._names[self.controls["sort"].value]
        for room in shown:
            scores = self._scores.of(room.index)
            names = [n for n in dict.fromkeys((chosen, *SHOWN_SCORES)) if n in scores]
            lines = {metric(name).title: _score(name, scores[name]) for name in names}
            absent = np.count_nonzero(~has_surfel(-self._points(room)[..., 2]))
            if absent:
                lines["Not shown"] = f"{absent} pixels whose depth is no place in view"
            text += paragraph(view_label(room)) + table(lines)
        return text

    def describe_surfel(self, cloud: Cloud, i: int) -> dict[str, str]:
        """Return both depths of a surfel's pixel, and the angle between its normals."""
        room, (y, x) = cloud.room, cloud.surfels.pixels[i]
        true, predicted = float(room.depth[y, x]), float(-self._points(room)[y, x, 2])
        lines = {
            "true depth": f"{true:.5f}",
            "predicted depth": f"{predicted:.5f}",
            "difference": f"{predicted - true:+.5f}",
        }
        normal = self._normal(room)
        if normal is not None and np.isfinite(normal[y, x]).all() and normal[y, x].any():
            (angle,) = angular_errors_degrees(normal[y, x : x + 1], room.normal[y, x : x + 1])
            lines["angle of normals"] = f"{angle:.1f}°"
        return lines

    def start(self, room: Room) -> Look:
        """Return how to look first: from farther back where both are beside each other."""
        look = super().start(room)
        if self.controls["place"].value != BESIDE:
            return look
        middle, width = look.target + aside(room) / 2, look.size[0] * (1 + GAP)
        position = middle + BACK * (look.position - look.target)
        return replace(look, position=position, target=middle, size=(width / BACK, 1 / BACK))


def aside(room: Room) -> Array:
    """Return by how much a prediction is moved to the right of a view to be beside the truth, (3,).

    World frame, scene units: a little more than the width of what the view shows.
    """
    right = room.world_from_camera[:3, 0]
    across = surfels_of(room).points @ right
    width = float(np.ptp(across)) if len(across) else 1.0
    return np.asarray(GAP * width * right)


def error_colors(error: Array, full: float) -> Array:
    """Return colours, (N, 3) uint8, of predicted minus true depths, (N,), NaN where not known.

    Blue is too near, grey is right, red is too far. Errors of `full` scene units and more have the
    full colour.
    """
    finite = np.isfinite(error)
    place = np.clip(np.where(finite, error, 0.0) / full, -1.0, 1.0)
    channels = zip(TOO_NEAR, RIGHT, TOO_FAR, strict=True)
    colors = np.stack([np.interp(place, (-1, 0, 1), channel) for channel in channels], axis=-1)
    colors[~finite] = UNKNOWN
    return np.rint(colors).astype(np.uint8)


def legend(full: float) -> str:
    """Return a bar of the colours of errors with its limits, as HTML."""
    stops = ", ".join(f"rgb{color}" for color in (TOO_NEAR, RIGHT, TOO_FAR))
    return (
        '<div style="margin:0.4em 0.8em;font-size:0.85em">'
        f'<div style="height:0.8em;background:linear-gradient(to right, {stops})"></div>'
        '<div style="display:flex;justify-content:space-between">'
        f"<span>{full:g} too near</span><span>right</span><span>{full:g} too far</span>"
        "</div></div>"
    )


def _score(name: str, value: float) -> str:
    if not np.isfinite(value):
        return "none"
    unit = metric(name).unit
    return f"{value:.4g} {UNITS.get(unit, unit)}".rstrip()

"""The 3D page: one scene at a time, controls beside it, and the values of a clicked surfel.

A file of rooms has one, with or without predictions beside the truth.
"""

import html
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SceneGenError
from scenegen.common.records import check
from scenegen.common.text_table import printable
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.viewing import drawing
from scenegen.viewing.geometry import (
    COLORINGS,
    Mesh,
    ShapeOf,
    Surfels,
    aside,
    check_camera,
    error_colors,
    has_surfel,
    hit_by,
    pictured,
    pixel_colors,
    scene_meshes,
    surfels_of,
)

if TYPE_CHECKING:
    from viser import SceneClickEvent, ViserServer

Array = NDArray[Any]
Scenes = Sequence[tuple[int, ...]]  # of each scene the rows of its views
ALL_VIEWS, ERROR = "All views", "Error: blue is too near, red too far"
TRUTH, PREDICTION = "/truth", "/prediction"  # of the page's tree
LAYERS = {  # controls that show a part of the scene
    "truth": "True surfels",
    "prediction": "Predicted surfels",
    "beside": "Prediction beside the truth",
    "meshes": "Object meshes",
    "cameras": "Cameras",
}
OF_PREDICTIONS = ("prediction", "beside")
MOST_REASONS = 3  # why meshes are missing
MOST_NAMED = 8  # objects, of more of which only classes are named
CLICK = 3.0  # pixels of the screen by which a click may miss
NOTHING_CLICKED = "Click on a surfel to read its values."
STYLE = "margin:0.4em 0.8em;font-size:0.85em;overflow-wrap:anywhere"


class Rooms(Protocol):
    """Views by their rows: a file of rooms, or what is shown as one."""

    def __getitem__(self, row: int) -> Room: ...


@dataclass(frozen=True, eq=False)
class Predicted:
    """Predictions of the rooms of a file.

    Attributes:
        orders: scenes from the worst to the best, by the titles of scores.
        points: returns those of a view, (H, W, 3), camera frame, scene units; NaN for none.
        normal: returns those of a view, (H, W, 3), camera frame; None where there are none.
        scores: returns the scores of a row as texts, by their titles; the first is of this title.
    """

    orders: Mapping[str, Scenes]
    points: Callable[[Room], Array]
    normal: Callable[[Room], Array] | None
    scores: Callable[[int, str], Mapping[str, str]]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Surfels of a view as they are drawn: `colors` is (N, 3) uint8, sRGB."""

    kind: str  # TRUTH or PREDICTION
    room: Room
    surfels: Surfels
    colors: Array


class RoomsPage:
    """The page of a file of rooms on a running server, which shows the first scene.

    Every change of a control draws anew, one change at a time.

    Args:
        server: from `server.started`; the page is gone when it ends.
        rooms: whose scenes are shown.
        shape_of: from `geometry.shapes_of`.
        scenes: from `scene_rows`.
        predicted: what is shown beside the truth; its orders replace that of `scenes`.

    Attributes:
        controls: viser's handles by name; what they show is their `value`.
        clouds: what is drawn now.
    """

    def __init__(
        self,
        server: "ViserServer",
        rooms: Rooms,
        shape_of: ShapeOf,
        scenes: Scenes,
        predicted: Predicted | None = None,
    ) -> None:
        self.controls: dict[str, Any] = {}
        self.clouds: list[Cloud] = []
        self._server, self._rooms, self._shape_of = server, rooms, shape_of
        self._scenes, self._predicted = scenes, predicted
        self._lock, self._drawing = threading.RLock(), False
        self._rows: tuple[int, ...] = ()
        self._views: dict[str, Room] = {}
        self._meshes: list[Mesh] = []
        self._reasons: list[str] = []  # why meshes are missing
        self._looking: tuple[Any, ...] = ()  # row that is looked at, and whether beside another
        gui, last = server.gui, len(scenes) - 1
        if predicted is not None:
            self._add("sort", gui.add_dropdown("Sort by", list(predicted.orders)))
        label = "Scene" if predicted is None else "Scene, 0 is the worst"
        self._add("scene", gui.add_slider(label, 0, last, 1, 0))
        self._add("view", gui.add_dropdown("View", [ALL_VIEWS]))
        self._about, self._clicked = gui.add_html(""), gui.add_html("")
        with gui.add_folder("What is drawn"):
            colorings = COLORINGS if predicted is None else (ERROR, *COLORINGS)
            self._add("colour", gui.add_dropdown("Colour of surfels", colorings))
            if predicted is not None:
                hint = "Error of depth, in scene units, that has the full colour."
                full = gui.add_number("Full colour at", 0.05, min=0.001, max=10, hint=hint)
                self._add("full", full)
            self._add("size", gui.add_slider("Size of surfels", 0.1, 4.0, 0.1, 2.0))
            # Cameras would hide predictions, which are looked at from behind them.
            later = () if predicted is None else ("cameras",)
            for name, label in LAYERS.items():
                if predicted is not None or name not in OF_PREDICTIONS:
                    self._add(name, gui.add_checkbox(label, name not in later))
        gui.add_button("Look from this view").on_click(lambda _: self._look())
        server.scene.on_click()(self._click)
        self.show()

    def _add(self, name: str, control: Any) -> None:
        """Draw anew whenever this control changes."""
        self.controls[name] = control
        control.on_update(lambda _: self.show())

    def _is_on(self, name: str) -> bool:
        return name in self.controls and bool(self.controls[name].value)

    @property
    def text(self) -> str:
        """What the page says of the scene, as HTML."""
        return str(self._about.content)

    @property
    def clicked(self) -> str:
        """What the page says of the pixel that was clicked last, as HTML."""
        return str(self._clicked.content)

    def show(self) -> None:
        """Draw what the controls say."""
        with self._lock:
            if self._drawing:  # a control that this changes itself
                return
            self._drawing = True
            try:
                with self._server.atomic():
                    self._update()
            except (SceneGenError, OSError) as error:
                self._server.scene.reset()
                self._rows, self._views, self.clouds = (), {}, []
                self._about.content = _paragraph(f"This scene cannot be shown. {error}")
            finally:
                self._drawing = False

    def _update(self) -> None:
        scenes = self._scenes
        if self._predicted is not None:
            scenes = self._predicted.orders[self.controls["sort"].value]
            if scenes is not self._scenes:  # sorted by another score
                self._scenes, self.controls["scene"].value = scenes, 0
        rows = scenes[min(max(self.controls["scene"].value, 0), len(scenes) - 1)]
        if rows != self._rows:
            rooms = [self._rooms[row] for row in rows]
            for room in rooms:
                check_camera(room)
            self._rows, self._views = rows, {_view_label(room): room for room in rooms}
            self._meshes, self._reasons = scene_meshes(rooms[0].scene, self._shape_of)
            if rooms[0].scene.interior:
                self._meshes = pictured(self._meshes, rooms)
            names = list(self._views)
            self.controls["view"].options = [*names, *([ALL_VIEWS] if len(names) > 1 else [])]
            self.controls["view"].value = names[0]
        shown = self._shown()
        self._draw(shown)
        self._about.content = self._description(shown)
        self._clicked.content = _paragraph(NOTHING_CLICKED)
        if self._looking != (shown[0].index, self._is_beside()):
            self._look()

    def _shown(self) -> list[Room]:
        chosen = self._views.get(self.controls["view"].value)
        return list(self._views.values()) if chosen is None else [chosen]

    def _draw(self, shown: Sequence[Room]) -> None:
        """Draw these views in the place of all that was drawn."""
        self._server.scene.reset()
        self.clouds = [cloud for room in shown for cloud in self._clouds_of(room)]
        for cloud in self.clouds:
            name, size = f"{cloud.kind}/{cloud.room.index}", self.controls["size"].value
            drawing.draw_surfels(self._server, name, cloud.surfels, cloud.colors, size)
        for mesh in self._meshes if self._is_on("meshes") else ():
            drawing.draw_mesh(self._server, mesh)
        for label, room in self._views.items() if self._is_on("cameras") else ():
            drawing.draw_camera(self._server, room, room in shown, partial(self._choose, label))

    def _clouds_of(self, room: Room) -> list[Cloud]:
        """Return the true surfels of a view, and the predicted ones."""
        coloring, clouds = self.controls["colour"].value, list[Cloud]()
        if self._is_on("truth"):
            surfels = surfels_of(room)
            pixels = pixel_colors(room, "Image" if coloring == ERROR else coloring)
            clouds.append(Cloud(TRUTH, room, surfels, surfels.of_pixels(pixels)))
        if self._predicted is None:
            return clouds
        if self._is_on("prediction"):
            points = self._predicted.points(room)
            surfels = surfels_of(room, points)
            if coloring == ERROR:
                error = surfels.of_pixels(-points[..., 2] - room.depth)
                colors = error_colors(error, self.controls["full"].value)
            else:
                colors = surfels.of_pixels(pixel_colors(self._with_normal(room), coloring))
            if self._is_beside():
                moved = (surfels.points + aside(room)).astype(np.float32)
                surfels = replace(surfels, points=moved)
            clouds.append(Cloud(PREDICTION, room, surfels, colors))
        return clouds

    def _with_normal(self, room: Room) -> Room:
        """Return a view with the predicted normals in the place of its own, where there are any."""
        if self._predicted is None or self._predicted.normal is None:
            return room
        normal = self._predicted.normal(room)
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        return replace(room, normal=np.nan_to_num(normal / np.where(length > 0, length, 1.0)))

    def _is_beside(self) -> bool:
        return all(map(self._is_on, ("truth", "prediction", "beside")))

    def _description(self, shown: Sequence[Room]) -> str:
        """Return what to say of these views, as HTML: scene, objects, scores, missing meshes."""
        scene, (height, width) = shown[0].scene, shown[0].depth.shape
        names = _names([item.shape for item in scene.objects])
        views = f"{len(scene.cameras)} views" if len(scene.cameras) > 1 else "1 view"
        size = f"{views} of {width} x {height} pixels"
        parts = [_paragraph(f"Scene {scene.index}: {size}. Objects: {names}.")]
        if self._predicted is not None:
            for room in shown:
                lines = dict(self._predicted.scores(room.index, self.controls["sort"].value))
                absent = np.count_nonzero(~has_surfel(-self._predicted.points(room)[..., 2]))
                if absent:
                    lines["Not shown"] = f"{absent} pixels whose depth is no place in view"
                parts += [_paragraph(_view_label(room)), _table(lines)]
        parts += [_paragraph(f"No mesh: {reason}.") for reason in self._reasons[:MOST_REASONS]]
        return "".join(parts)

    def _choose(self, label: str) -> None:
        self.controls["view"].value = label
        self._look()

    def _look(self) -> None:
        for room in self._shown()[:1]:
            self._looking = room.index, self._is_beside()
            drawing.look_from(self._server, room, aside(room) if self._is_beside() else None)

    def _click(self, event: "SceneClickEvent") -> None:
        """Mark the surfel that a click hits first, and its pixel in other clouds; describe it."""
        camera = event.client.camera
        angle = CLICK * camera.fov / max(camera.image_height, 1)
        ray = np.array(event.ray_origin), np.array(event.ray_direction)
        with self._lock:
            hits = [(hit_by(cloud.surfels, *ray, angle), cloud) for cloud in self.clouds]
            near = [(hit[1], hit[0], cloud) for hit, cloud in hits if hit is not None]
            if not near:
                drawing.mark(self._server, [], 0.0)
                self._clicked.content = _paragraph(NOTHING_CLICKED)
                return
            _, i, cloud = min(near, key=lambda hit: hit[0])
            y, x = cloud.surfels.pixels[i]
            points = [cloud.surfels.points[i]]
            for other in self.clouds:
                if other is not cloud and other.room is cloud.room:
                    there = (other.surfels.pixels == (y, x)).all(axis=1)
                    points += list(other.surfels.points[there])
            drawing.mark(self._server, points, cloud.surfels.spacing)
            self._clicked.content = _table(self._pixel_lines(cloud.room, int(y), int(x)))

    def _pixel_lines(self, room: Room, y: int, x: int) -> dict[str, str]:
        """Return what to say of a pixel of a view, true and predicted, by title."""
        depth, point = float(room.depth[y, x]), room.points_world[y, x]
        lines = {
            "view": _view_label(room),
            "pixel": f"row {y}, column {x}",
            "object": _object_name(room, int(room.object_id[y, x])),
            "depth": f"{depth:.5f}",
            "normal": ", ".join(f"{value:.3f}" for value in room.normal[y, x]) + " (camera)",
            "point": ", ".join(f"{value:.4f}" for value in point) + " (world)",
        }
        if self._predicted is not None:
            predicted = -float(self._predicted.points(room)[y, x, 2])
            lines["predicted depth"] = f"{predicted:.5f}"
            lines["difference"] = f"{predicted - depth:+.5f}"
            if self._predicted.normal is not None:
                normal = self._predicted.normal(room)[y, x]
                lines["predicted normal"] = ", ".join(f"{value:.3f}" for value in normal)
        return lines


def scene_rows(rooms: RoomsFile, items: Sequence[int] | None = None) -> list[tuple[int, ...]]:
    """Return the rows of each scene, of all rows or of `items`, in the order of their first rows.

    Raises SpecError for rows that the file does not have.
    """
    rows = range(len(rooms)) if items is None else sorted(set(items))
    beyond = [row for row in rows if row >= len(rooms)]
    check(not beyond, "items", min(beyond, default=0), f"rows from 0 to {len(rooms) - 1}")
    scene_index = rooms.read("scene_index", slice(None))
    scenes: dict[int, list[int]] = {}
    for row in rows:
        scenes.setdefault(int(scene_index[row]), []).append(row)
    return [tuple(views) for views in scenes.values()]


def _names(shapes: Sequence[str]) -> str:
    """Return the names of objects, or of many objects their classes and how many are of each."""
    if len(shapes) <= MOST_NAMED:
        return ", ".join(shapes) or "none"
    classes = Counter(shape.partition("/")[0] for shape in shapes)
    return ", ".join(f"{name} {count}" for name, count in sorted(classes.items()))


def _view_label(room: Room) -> str:
    return f"View {room.view_index}, row {room.index}"


def _object_name(room: Room, object_id: int) -> str:
    if object_id < 1:
        return "0, the room" if object_id == 0 else "nothing"
    items = room.scene.objects[object_id - 1 : object_id]
    return ", ".join([str(object_id), *(item.shape for item in items)])


def _paragraph(text: str) -> str:
    """Return a text as a paragraph of HTML; names in it may come from other people's files."""
    return f'<p style="{STYLE}">{html.escape(printable(text))}</p>'


def _table(lines: Mapping[str, str]) -> str:
    """Return names and values as a table in HTML."""
    rows = "".join(
        f'<tr><th scope="row" style="text-align:left;padding-right:0.8em">'
        f"{html.escape(name)}</th><td>{html.escape(printable(text))}</td></tr>"
        for name, text in lines.items()
    )
    return f'<table style="{STYLE}">{rows}</table>'

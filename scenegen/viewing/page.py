"""The 3D page: one scene at a time, controls beside it, and the values of a clicked surfel."""

import html
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

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
    check_camera,
    has_surfel,
    hit_by,
    pixel_colors,
    scene_meshes,
    surfels_of,
)

if TYPE_CHECKING:
    from viser import ClientHandle, SceneClickEvent, ViserServer

Array = NDArray[Any]
ALL_VIEWS = "All views"
LAYERS = {  # controls that show a part of the scene: name, and whether it is shown first
    "surfels": ("Surfels", True),
    "meshes": ("Object meshes", True),
    "room": ("Room mesh", False),
    "cameras": ("Cameras", True),
    "lights": ("Lights", True),
}
MOST_REASONS = 3  # why meshes are missing
CLICK = 3.0  # pixels of the screen by which a click may miss
NOTHING_CLICKED = "Click on a surfel to read its values."
LOOK = "margin:0.4em 0.8em;font-size:0.85em;overflow-wrap:anywhere"


@dataclass(frozen=True, eq=False)
class Cloud:
    """Surfels of a view as they are drawn.

    Attributes:
        name: where they are in the page's tree, such as "/truth/0".
        colors: (N, 3) uint8, sRGB.
    """

    name: str
    room: Room
    surfels: Surfels
    colors: Array


class ScenePage:
    """The page of a file of rooms on a running server, empty until `show` is called.

    Every change of a control draws anew, one change at a time.

    Args:
        server: from `server.started`; the page is gone when it ends.
        rooms: whose scenes are shown.
        shape_of: from `geometry.shapes_of`.
        scenes: from `scene_rows`.

    Attributes:
        controls: viser's handles by name; what they show is their `value`.
        clouds: what is drawn now.
    """

    scene_label = "Scene"
    layers = LAYERS

    def __init__(
        self,
        server: "ViserServer",
        rooms: RoomsFile,
        shape_of: ShapeOf,
        scenes: Sequence[tuple[int, ...]],
    ) -> None:
        self.scenes = scenes
        self.controls: dict[str, Any] = {}
        self.clouds: list[Cloud] = []
        self._server, self._rooms, self._shape_of = server, rooms, shape_of
        self._lock, self._drawing = threading.RLock(), False
        self._rows: tuple[int, ...] = ()
        self._views: dict[str, Room] = {}
        self._meshes: list[Mesh] = []
        self._reasons: list[str] = []  # why meshes are missing
        self._looking: drawing.Look | None = None
        gui = server.gui
        self.add("scene", gui.add_slider(self.scene_label, 0, len(scenes) - 1, 1, 0))
        self.add("view", gui.add_dropdown("View", [ALL_VIEWS]))
        self._about, self._clicked = gui.add_html(""), gui.add_html("")
        with gui.add_folder("What is drawn"):
            self.add("colour", gui.add_dropdown("Colour of surfels", COLORINGS))
            self.add("size", gui.add_slider("Size of surfels", 0.1, 4.0, 0.1, 2.0))
            for name, (label, shown) in self.layers.items():
                self.add(name, gui.add_checkbox(label, shown))
        hint = "Moves you to the camera of a view when you choose one."
        self.add("follow", gui.add_checkbox("Look from each new view", True, hint=hint))
        gui.add_button("Look from this view").on_click(lambda _: self._look())
        server.scene.on_click()(self._click)
        server.on_client_connect(lambda client: self._look_again([client]))

    def add(self, name: str, control: Any) -> Any:
        """Draw anew whenever this control changes; return it."""
        self.controls[name] = control
        control.on_update(lambda _: self.show())
        return control

    @property
    def text(self) -> str:
        """What the page says of the scene, as HTML."""
        return str(self._about.content)

    def make_clouds(self, shown: Sequence[Room]) -> list[Cloud]:
        """Return what to draw of these views."""
        return [self.truth_cloud(room) for room in shown]

    def truth_cloud(self, room: Room) -> Cloud:
        """Return the true surfels of a view."""
        surfels = surfels_of(room)
        colors = surfels.of_pixels(pixel_colors(room, self.controls["colour"].value))
        return Cloud(f"/truth/{room.index}", room, surfels, colors)

    def describe(self, shown: Sequence[Room]) -> str:
        """Return what to say of these views, as HTML: scene, objects, size of the images."""
        room = shown[0]
        names = ", ".join(item.shape for item in room.scene.objects) or "none"
        height, width = room.depth.shape
        count = len(room.scene.cameras)
        views = f"{count} views" if count > 1 else "1 view"
        return paragraph(
            f"Scene {room.scene.index}: {views} of {width} x {height} pixels. Objects: {names}."
        )

    def describe_surfel(self, cloud: Cloud, i: int) -> dict[str, str]:
        """Return what to say of the i-th surfel of a cloud."""
        room, (y, x) = cloud.room, cloud.surfels.pixels[i]
        point, normal = cloud.surfels.points[i], room.normal[y, x]
        return {
            "depth": f"{room.depth[y, x]:.5f}",
            "normal": ", ".join(f"{value:.3f}" for value in normal) + " (camera)",
            "point": ", ".join(f"{value:.4f}" for value in point) + " (world)",
        }

    def start(self, room: Room) -> drawing.Look:
        """Return how to look first: from a view's camera, at a point at the median depth."""
        position, back = room.world_from_camera[:3, 3], room.world_from_camera[:3, 2]
        depth, (height, width) = room.depth[has_surfel(room.depth)], room.depth.shape
        target = position - back * (float(np.median(depth)) if depth.size else 1.0)
        return drawing.Look(position, target, room.fov_y_degrees, (width / height, 1.0))

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
                self._about.content = paragraph(f"This scene cannot be shown. {error}")
            finally:
                self._drawing = False

    def _update(self) -> None:
        rows = self.scenes[min(max(self.controls["scene"].value, 0), len(self.scenes) - 1)]
        if rows != self._rows:
            rooms = [self._rooms[row] for row in rows]
            for room in rooms:
                check_camera(room)
            self._rows, self._views = rows, {view_label(room): room for room in rooms}
            self._meshes, self._reasons = scene_meshes(rooms[0].scene, self._shape_of)
            names = list(self._views)
            self.controls["view"].options = [*names, *([ALL_VIEWS] if len(names) > 1 else [])]
            self.controls["view"].value = names[0]
        shown = self._shown()
        self._draw(shown)
        reasons = self._reasons[:MOST_REASONS]
        missing = "".join(paragraph(f"No mesh: {reason}.") for reason in reasons)
        self._about.content = self.describe(shown) + missing
        self._clicked.content = paragraph(NOTHING_CLICKED)
        start, last = self.start(shown[0]), self._looking
        same = last is not None and np.array_equal(
            (start.position, start.target), (last.position, last.target)
        )
        if self.controls["follow"].value and not same:
            self._look()

    def _shown(self) -> list[Room]:
        chosen = self._views.get(self.controls["view"].value)
        return list(self._views.values()) if chosen is None else [chosen]

    def _draw(self, shown: Sequence[Room]) -> None:
        """Draw these views in the place of all that was drawn."""
        is_on = {name: self.controls[name].value for name in LAYERS}
        self._server.scene.reset()
        self.clouds = self.make_clouds(shown) if is_on["surfels"] else []
        for cloud in self.clouds:
            size = self.controls["size"].value
            drawing.draw_surfels(self._server, cloud.name, cloud.surfels, cloud.colors, size)
        for mesh in self._meshes:
            if is_on["meshes" if mesh.object_id else "room"]:
                drawing.draw_mesh(self._server, mesh)
        for label, room in self._views.items() if is_on["cameras"] else ():
            drawing.draw_camera(self._server, room, room in shown, partial(self._choose, label))
        if is_on["lights"]:
            drawing.draw_lights(self._server, shown[0].scene)

    def _choose(self, label: str) -> None:
        self.controls["view"].value = label
        self._look()

    def _look(self) -> None:
        for room in self._shown()[:1]:
            self._looking = how = self.start(room)
            first = self._server.initial_camera  # where "Reset view" goes
            first.position, first.look_at, first.up = how.position, how.target, drawing.UP
            self._look_again(self._server.get_clients().values())

    def _look_again(self, clients: Iterable["ClientHandle"]) -> None:
        if self._looking is not None:
            for client in clients:
                drawing.look(client, self._looking)

    def _click(self, event: "SceneClickEvent") -> None:
        """Mark the surfel that a click hits first, and its pixel in other clouds; describe it."""
        camera = event.client.camera
        angle = CLICK * camera.fov / max(camera.image_height, 1)
        ray = np.array(event.ray_origin), np.array(event.ray_direction)
        with self._lock:
            hits = [(hit_by(cloud.surfels, *ray, angle), cloud) for cloud in self.clouds]
            near = [(hit[1], hit[0], cloud) for hit, cloud in hits if hit is not None]
            drawing.clear_mark(self._server)
            self._clicked.content = paragraph(NOTHING_CLICKED)
            if not near:
                return
            _, i, cloud = min(near, key=lambda hit: hit[0])
            y, x = cloud.surfels.pixels[i]
            points = [cloud.surfels.points[i]]
            for other in self.clouds:
                if other is not cloud and other.room is cloud.room:
                    there = (other.surfels.pixels == (y, x)).all(axis=1)
                    points += list(other.surfels.points[there])
            drawing.draw_mark(self._server, points, cloud.surfels.spacing)
            lines = {"view": view_label(cloud.room), "pixel": f"row {y}, column {x}"}
            lines["object"] = object_name(cloud.room, int(cloud.room.object_id[y, x]))
            self._clicked.content = table(lines | self.describe_surfel(cloud, i))


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


def view_label(room: Room) -> str:
    """Return the name of a view for the list of views."""
    return f"View {room.view_index}, row {room.index}"


def object_name(room: Room, object_id: int) -> str:
    """Return an object id in words."""
    if object_id < 1:
        return "0, the room" if object_id == 0 else "nothing"
    items = room.scene.objects[object_id - 1 : object_id]
    return ", ".join([str(object_id), *(item.shape for item in items)])


def paragraph(text: str) -> str:
    """Return a text as a paragraph of HTML; names in it may come from other people's files."""
    return f'<p style="{LOOK}">{html.escape(printable(text))}</p>'


def table(lines: Mapping[str, str]) -> str:
    """Return names and values as a table in HTML."""
    rows = "".join(
        f'<tr><th scope="row" style="text-align:left;padding-right:0.8em">'
        f"{html.escape(name)}</th><td>{html.escape(printable(text))}</td></tr>"
        for name, text in lines.items()
    )
    return f'<table style="{LOOK}">{rows}</table>'

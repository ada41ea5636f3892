"""The 3D page: one scene at a time, controls beside it, and what is known of a clicked surfel."""

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from scenegen.common.errors import SceneGenError
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.viewing import drawing
from scenegen.viewing.contents import Cloud, Contents, paragraph
from scenegen.viewing.geometry import (
    COLORINGS,
    Mesh,
    ShapeOf,
    check_camera,
    hit_by,
    scene_meshes,
)

if TYPE_CHECKING:
    from viser import SceneClickEvent, ViserServer

ALL_VIEWS = "All views"
MOST_TOLD = 3  # meshes that are missing
CLICK = 3.0  # pixels of the screen by which a click may miss
NOTHING_CLICKED = "Click on a surfel to read its values."


class ScenePage:
    """The page on a running server, empty until `show` is called.

    Every change of a control draws anew, one change at a time.

    Args:
        server: from `server.started`; the page is gone when it ends.
        rooms: whose scenes are shown.
        shape_of: from `geometry.shapes_of`.

    Attributes:
        controls: viser's handles by name; what they show is their `value`.
    """

    def __init__(
        self,
        server: "ViserServer",
        rooms: RoomsFile,
        shape_of: ShapeOf,
        contents: Contents,
    ) -> None:
        self._server, self._rooms, self._shape_of = server, rooms, shape_of
        self._contents = contents
        self._lock, self._drawing = threading.RLock(), False
        self._rows: tuple[int, ...] = ()
        self._views: dict[str, Room] = {}
        self._meshes: list[Mesh] = []
        self._clouds: list[Cloud] = []
        self._state: list[Any] = []
        self._missing = ""
        self._start = np.zeros((2, 3))  # where the page looked from last, and at what
        self._nodes: dict[str, Any] = {}
        self.controls: dict[str, Any] = {}
        self._add_controls()
        server.scene.on_click()(self._click)

    def _add_controls(self) -> None:
        gui = self._server.gui
        last = len(self._contents.scenes()) - 1
        self.add("scene", gui.add_slider(self._contents.scene_label, 0, last, 1, 0))
        self.add("view", gui.add_dropdown("View", [ALL_VIEWS]))
        self._about = gui.add_html("")
        self._clicked = gui.add_html("")
        with gui.add_folder("What is drawn"):
            self.add("colour", gui.add_dropdown("Colour of surfels", COLORINGS))
            self.add("size", gui.add_slider("Size of surfels", 0.1, 4.0, 0.1, 2.0))
            self.add("surfels", gui.add_checkbox("Surfels", True))
            self.add("meshes", gui.add_checkbox("Object meshes", True))
            self.add("room", gui.add_checkbox("Room mesh", False))
            self.add("cameras", gui.add_checkbox("Cameras", self._contents.cameras))
            self.add("lights", gui.add_checkbox("Lights", True))
        hint = "Moves you to the camera of a view when you choose one."
        self.add("follow", gui.add_checkbox("Look from each new view", True, hint=hint))
        gui.add_button("Look from this view").on_click(lambda _: self._look())

    def add(self, name: str, control: Any) -> Any:
        """Draw anew whenever this control changes; return it."""
        self.controls[name] = control
        control.on_update(lambda _: self.show())
        return control

    @property
    def told(self) -> str:
        """What the page says of the scene, as HTML."""
        return str(self._about.content)

    def restart(self) -> None:
        """Go to the first scene."""
        self.controls["scene"].value = 0

    def show(self) -> None:
        """Draw what the controls say, unless it is drawn already."""
        with self._lock:
            if self._drawing:  # a control that this changes itself
                return
            self._drawing = True
            try:
                with self._server.atomic():
                    self._update()
            except (SceneGenError, OSError) as error:
                self._remove(self._nodes)
                self._rows, self._views, self._nodes, self._clouds = (), {}, {}, []
                self._about.content = paragraph(f"This scene cannot be shown. {error}")
            finally:
                self._drawing = False

    def _update(self) -> None:
        scenes = self._contents.scenes()
        rows = tuple(scenes[min(max(self.controls["scene"].value, 0), len(scenes) - 1)])
        new_scene = rows != self._rows
        if new_scene:
            rooms = [self._rooms[row] for row in rows]
            for room in rooms:
                check_camera(room)
            self._rows, self._views = rows, {self._contents.label(room): room for room in rooms}
            self._meshes, missing = scene_meshes(rooms[0].scene, self._shape_of)
            self._missing = "".join(paragraph(f"No mesh: {text}.") for text in missing[:MOST_TOLD])
            names = list(self._views)
            self.controls["view"].options = [*names, *([ALL_VIEWS] if len(names) > 1 else [])]
            self.controls["view"].value = names[0]
        state = [control.value for control in self.controls.values()]
        if not new_scene and state == self._state:  # a newer change was drawn meanwhile
            return
        self._state = state
        drawing.clear_mark(self._server)
        self._clicked.content = paragraph(NOTHING_CLICKED)
        shown = self._shown()
        self._draw(shown)
        self._about.content = self._contents.about(shown) + self._missing
        start = np.array(self._contents.start(shown[0]))
        if self.controls["follow"].value and not np.array_equal(start, self._start):
            self._look()

    def _shown(self) -> list[Room]:
        chosen = self._views.get(self.controls["view"].value)
        return list(self._views.values()) if chosen is None else [chosen]

    def _draw(self, shown: Sequence[Room]) -> None:
        """Draw these views; remove what was drawn before."""
        before, self._nodes = self._nodes, {}
        self._clouds = self._contents.clouds(shown, self.controls["colour"].value)
        for cloud in self._clouds if self.controls["surfels"].value else ():
            self._keep(drawing.draw_surfels(
                self._server, cloud.name, cloud.surfels, cloud.colors, self.controls["size"].value
            ))  # fmt: skip
        for mesh in self._meshes:
            if self.controls["meshes"].value if mesh.object_id else self.controls["room"].value:
                name = f"/meshes/{mesh.object_id}"
                self._keep(drawing.draw_mesh(self._server, name, mesh))
        if self.controls["cameras"].value:
            for room in self._views.values():
                self._keep(self._draw_camera(room, room in shown))
        if self.controls["lights"].value:
            for node in drawing.draw_lights(self._server, shown[0].scene):
                self._keep(node)
        self._remove({name: before[name] for name in before.keys() - self._nodes.keys()})

    def _remove(self, nodes: dict[str, Any]) -> None:
        for name, node in nodes.items():
            there: Any = self._server.scene.get_handle_by_name(name)
            if there is node:  # it goes with its parent
                node.remove()

    def _keep(self, node: Any) -> None:
        self._nodes[node.name] = node

    def _draw_camera(self, room: Room, shown: bool) -> Any:
        def choose() -> None:
            self.controls["view"].value = self._contents.label(room)
            self._look()

        return drawing.draw_camera(self._server, f"/cameras/{room.index}", room, shown, choose)

    def _look(self) -> None:
        for room in self._shown()[:1]:
            position, target = self._contents.start(room)
            self._start = np.array([position, target])
            drawing.look(self._server, position, target, room.fov_y_degrees)

    def _click(self, event: "SceneClickEvent") -> None:
        """Mark the surfel that a click hits first, and say what is known of it."""
        camera = event.client.camera
        angle = CLICK * camera.fov / max(camera.image_height, 1)
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        with self._lock:
            found = []
            for cloud in self._clouds if self.controls["surfels"].value else ():
                hit = hit_by(cloud.surfels, origin, direction, angle)
                if hit is not None:
                    found.append((hit[1], hit[0], cloud))
            if not found:
                drawing.clear_mark(self._server)
                self._clicked.content = paragraph(NOTHING_CLICKED)
                return
            _, i, cloud = min(found, key=lambda one: one[0])
            points = [cloud.surfels.points[i].astype(float)]
            if cloud.partners is not None and np.isfinite(cloud.partners[i]).all():
                points.append(cloud.partners[i].astype(float))
            drawing.draw_mark(self._server, points, cloud.surfels.spacing)
            self._clicked.content = cloud.tell(i)

"""What a 3D page shows: rows of a file of rooms, their surfels, and what is said of them."""

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.records import check
from scenegen.common.text_table import printable
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.viewing.geometry import Surfels, has_surfel, pixel_colors, surfels_of

Array = NDArray[Any]
Place = tuple[Array, Array]  # a point to look from and one to look at, (3,) each, world
LOOK = "margin:0.4em 0.8em;font-size:0.85em;overflow-wrap:anywhere"


@dataclass(frozen=True, eq=False)
class Cloud:
    """Surfels as they are drawn.

    Attributes:
        name: where they are in the page's tree, such as "/truth/0".
        colors: (N, 3) uint8, sRGB.
        tell: returns what is known of the i-th surfel, as HTML.
        partners: where the same pixels are in another cloud, (N, 3), world, NaN where they are not;
            a click marks both. None where there is no other.
    """

    name: str
    surfels: Surfels
    colors: Array
    tell: Callable[[int], str]
    partners: Array | None = None


@dataclass(frozen=True)
class Contents:
    """What a page shows of a file of rooms.

    Attributes:
        scenes: returns the rows of each scene's views, in the order in which the slider shows them.
        label: returns the name of the view in a row, for the list of views.
        clouds: returns what to draw of rows that are shown; the text is one of COLORINGS.
        about: returns what to say of them, as HTML.
        start: returns from where to look at a row.
        scene_label: of the slider over scenes.
        cameras: whether to draw the cameras until the person says otherwise.
    """

    scenes: Callable[[], Sequence[tuple[int, ...]]]
    label: Callable[[Room], str]
    clouds: Callable[[Sequence[Room], str], list[Cloud]]
    about: Callable[[Sequence[Room]], str]
    start: Callable[[Room], Place]
    scene_label: str = "Scene"
    cameras: bool = True


def rooms_contents(rooms: RoomsFile, rows: Sequence[int] | None = None) -> Contents:
    """Return what a page shows of a file of rooms, or some rows: their scenes in the file's order.

    Raises SpecError for rows that the file does not have.
    """
    every = range(len(rooms))
    beyond = [row for row in rows or () if row not in every]
    check(not beyond, "items", min(beyond, default=0), f"rows from 0 to {len(rooms) - 1}")
    scenes = tuple(scene_rows(rooms, every if rows is None else sorted(set(rows))))

    def clouds(shown: Sequence[Room], coloring: str) -> list[Cloud]:
        return [truth_cloud(room, coloring) for room in shown]

    return Contents(lambda: scenes, view_label, clouds, about_scene, start_at_view)


def scene_rows(rooms: RoomsFile, rows: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the rows of each scene, scenes in the order in which their first rows come."""
    scene_index = rooms.read("scene_index", slice(None))
    found: dict[int, list[int]] = {}
    for row in rows:
        found.setdefault(int(scene_index[row]), []).append(row)
    return [tuple(some) for some in found.values()]


def view_label(room: Room) -> str:
    """Return the name of a view for the list of views."""
    return f"View {room.view_index}, row {room.index}"


def start_at_view(room: Room) -> Place:
    """Return where the camera of a view is, and a point that it looks at, at the median depth."""
    position, back = room.world_from_camera[:3, 3], room.world_from_camera[:3, 2]
    depth = room.depth[has_surfel(room.depth)]
    return position, position - back * (float(np.median(depth)) if depth.size else 1.0)


def truth_cloud(room: Room, coloring: str, tell: Callable[[int], str] | None = None) -> Cloud:
    """Return the true surfels of a view."""
    surfels = surfels_of(room.depth, room.fov_y_degrees, room.world_from_camera)

    def told(i: int) -> str:
        y, x = surfels.pixels[i]
        place = ", ".join(f"{value:.4f}" for value in surfels.points[i])
        return table(
            view=view_label(room),
            pixel=f"row {y}, column {x}",
            depth=f"{room.depth[y, x]:.5f}",
            object=object_name(room, int(room.object_id[y, x])),
            normal=", ".join(f"{value:.3f}" for value in room.normal[y, x]) + " (camera)",
            point=f"{place} (world)",
        )

    colors = surfels.of_pixels(pixel_colors(room, coloring))
    return Cloud(f"/truth/{room.index}", surfels, colors, tell or told)


def object_name(room: Room, object_id: int) -> str:
    """Return an object id in words."""
    if object_id < 1:
        return "0, the room" if object_id == 0 else "nothing"
    known = room.scene.objects[object_id - 1 : object_id]
    return ", ".join([str(object_id), *(item.shape for item in known)])


def about_scene(shown: Sequence[Room]) -> str:
    """Return what is shown, as HTML: scene, objects, size of the images."""
    room = shown[0]
    names = ", ".join(item.shape for item in room.scene.objects) or "none"
    height, width = room.depth.shape
    views = len(room.scene.cameras)
    of_views = f"{views} views" if views > 1 else "1 view"
    return paragraph(
        f"Scene {room.scene.index}: {of_views} of {width} x {height} pixels. Objects: {names}."
    )


def paragraph(text: str) -> str:
    """Return a text as a paragraph of HTML; names in it may come from other people's files."""
    return f'<p style="{LOOK}">{html.escape(printable(text))}</p>'


def table(**lines: str) -> str:
    """Return names and values as a table in HTML."""
    rows = "".join(
        f'<tr><th scope="row" style="text-align:left;padding-right:0.8em">'
        f"{html.escape(name.replace('_', ' '))}</th><td>{html.escape(printable(text))}</td></tr>"
        for name, text in lines.items()
    )
    return f'<table style="{LOOK}">{rows}</table>'

"""Arrays on a 3D page: surfels, meshes, cameras, lights, and the camera that looks at them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import Room
from scenegen.viewing.geometry import Mesh, Surfels

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer

    from scenegen.description.scenes import SceneSpec

Array = NDArray[Any]
OPENCV = np.diag([1.0, -1.0, -1.0])  # from its axes (y down, z forward) to those of `camera`
FRUSTUM = 0.12  # scene units
SHOWN, OTHER = (30, 110, 200), (150, 150, 150)  # colours of cameras
LIGHT = 0.04  # radius, scene units
UP = np.array([0.0, 1.0, 0.0])
NARROW = 576  # pixels; in narrower pages viser puts its controls over the lower part
FREE = 0.4  # of the height of such a page
MARK, MARK_COLOR = "/mark", (220, 0, 160)


def draw_surfels(
    server: "ViserServer", name: str, surfels: Surfels, colors: Array, size: float
) -> None:
    """Draw surfels as squares, `size` times as wide as a pixel; colours are (N, 3) uint8."""
    server.scene.add_point_cloud(
        name,
        surfels.points,
        colors,
        point_size=max(surfels.spacing, 1e-6) * size / 2,  # viser takes half of the width
        point_shape="square",
        point_shading="flat",
        precision="float32",
    )


def draw_mesh(server: "ViserServer", mesh: Mesh) -> None:
    """Draw triangles, each shaded by itself; the room is seen from inside only."""
    server.scene.add_mesh_simple(
        f"/meshes/{mesh.object_id}",
        mesh.triangles.reshape(-1, 3),
        np.arange(3 * len(mesh.triangles)).reshape(-1, 3),
        color=mesh.color,
        flat_shading=True,
        side="double" if mesh.object_id else "front",
    )


def draw_camera(
    server: "ViserServer", room: Room, shown: bool, clicked: Callable[[], None]
) -> None:
    """Draw the camera of a view as a frustum; `clicked` is called when it is."""
    from viser.transforms import SO3

    height, width = room.depth.shape
    handle = server.scene.add_camera_frustum(
        f"/cameras/{room.index}",
        np.radians(room.fov_y_degrees),
        width / height,
        scale=FRUSTUM,
        thickness=1.5,
        thickness_units="screen",
        color=SHOWN if shown else OTHER,
        wxyz=SO3.from_matrix(room.world_from_camera[:3, :3] @ OPENCV).wxyz,
        position=room.world_from_camera[:3, 3],
    )
    handle.on_click(lambda _: clicked())


def draw_lights(server: "ViserServer", scene: "SceneSpec") -> None:
    """Draw lights as balls of their colour, the brightest channel full, each with its number."""
    for k, light in enumerate(scene.lights):
        color = srgb_bytes(np.array(light.color) / max(*light.color, 1e-12))
        server.scene.add_icosphere(f"/lights/{k}", LIGHT, color, position=light.position)
        server.scene.add_label(f"/lights/{k}/label", f"Light {k}")


def draw_mark(server: "ViserServer", points: Sequence[Array], size: float) -> None:
    """Draw a ball of this radius at each point, (3,), and a line from the first to each other."""
    for k, point in enumerate(points):
        server.scene.add_icosphere(f"{MARK}/{k}", size, MARK_COLOR, position=point)
    if len(points) > 1:
        lines = np.array([[points[0], other] for other in points[1:]])
        server.scene.add_line_segments(
            f"{MARK}/line", lines, MARK_COLOR, thickness=2.0, thickness_units="screen"
        )


def clear_mark(server: "ViserServer") -> None:
    """Remove what `draw_mark` drew."""
    server.scene.remove_by_name(MARK)


@dataclass(frozen=True, eq=False)
class Look:
    """A way to look at a scene, with y up.

    Attributes:
        position, target: points to look from and at, (3,), world.
        size: width and height of what has to be in view, in heights of the field of view.
    """

    position: Array
    target: Array
    fov_y_degrees: float
    size: tuple[float, float]


def look(client: "ClientHandle", how: Look) -> None:
    """Let a browser look so; with a larger field of view where its page is too narrow for that."""
    camera = client.camera
    free = FREE if camera.image_width < NARROW else 1.0
    larger = max(1.0, how.size[0] / camera.aspect, how.size[1] / free)
    half = larger * np.tan(np.radians(how.fov_y_degrees) / 2)
    forward = how.target - how.position
    right = np.cross(forward, UP)
    above = np.cross(right, forward) / max(float(np.linalg.norm(right)), 1e-12)  # as long
    with client.atomic():
        camera.position = how.position
        camera.look_at = how.target - (1 - free) * half * above
        camera.up_direction, camera.fov = UP, float(2 * np.arctan(half))

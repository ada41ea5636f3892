"""Arrays on a 3D page: surfels, meshes, cameras, lights, and the camera that looks at them."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import Room
from scenegen.viewing.geometry import Mesh, Surfels

if TYPE_CHECKING:
    from viser import ViserServer

    from scenegen.description.scenes import SceneSpec

Array = NDArray[Any]
OPENCV = np.diag([1.0, -1.0, -1.0])  # from its axes (y down, z forward) to those of `camera`
FRUSTUM = 0.12  # scene units
SHOWN, OTHER = (30, 110, 200), (150, 150, 150)  # colours of cameras
LIGHT = 0.04  # radius, scene units
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


def look(server: "ViserServer", position: Array, target: Array, fov_y_degrees: float) -> None:
    """Let all browsers, and those to come, look from a point, (3,), at a target, with y up."""
    up, fov = np.array([0.0, 1.0, 0.0]), float(np.radians(fov_y_degrees))
    start = server.initial_camera
    start.position, start.look_at, start.up, start.fov = position, target, up, fov
    for client in server.get_clients().values():
        with client.atomic():
            client.camera.position, client.camera.look_at = position, target
            client.camera.up_direction, client.camera.fov = up, fov

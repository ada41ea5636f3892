"""Arrays on a 3D page: surfels, meshes, cameras, marks, and where a browser looks from."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenegen.rooms.reader import Room
from scenegen.viewing.geometry import Mesh, Surfels, has_surfel

if TYPE_CHECKING:
    from viser import ViserServer

Array = NDArray[Any]
OPENCV = np.diag([1.0, -1.0, -1.0])  # from its axes (y down, z forward) to those of `camera`
FRUSTUM = 0.12  # scene units
SHOWN, OTHER = (30, 110, 200), (150, 150, 150)  # colours of cameras
BACK = 2.2  # how many times farther than a view's camera it and a prediction are looked at from
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
    """Draw triangles, each shaded by itself."""
    corners = mesh.triangles.reshape(-1, 3)
    server.scene.add_mesh_simple(
        f"/meshes/{mesh.object_id}",
        corners,
        np.arange(len(corners)).reshape(-1, 3),
        color=mesh.color,
        flat_shading=True,
        side="double",
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


def mark(server: "ViserServer", points: Sequence[Array], size: float) -> None:
    """Draw a ball of this radius at each point, (3,), in the place of those that were marked."""
    server.scene.remove_by_name(MARK)
    for k, point in enumerate(points):
        server.scene.add_icosphere(f"{MARK}/{k}", size, MARK_COLOR, position=point)


def look_from(server: "ViserServer", room: Room, beside: Array | None) -> None:
    """Let all browsers look as a view's camera does, at a point at the median depth.

    Args:
        beside: by how much something else is moved, (3,), that is looked at, too, from farther back
            and from the middle of both; or None.
    """
    position, back = room.world_from_camera[:3, 3], room.world_from_camera[:3, 2]
    depth = room.depth[has_surfel(room.depth)]
    target = position - back * (float(np.median(depth)) if depth.size else 1.0)
    if beside is not None:
        target, position = target + beside / 2, target + beside / 2 + BACK * (position - target)
    cameras: list[Any] = [client.camera for client in server.get_clients().values()]
    # The initial one is where "Reset view" goes, and that of browsers to come.
    for camera in (server.initial_camera, *cameras):
        camera.position, camera.look_at = position, target
        camera.fov = float(np.radians(room.fov_y_degrees))

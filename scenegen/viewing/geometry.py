"""What a scene looks like in 3D, as plain arrays: surfels, their colours, meshes, and clicks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_size, transform_points, transform_vectors
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.description.specs import BUILT_IN, Request
from scenegen.objects.scene_mesh import world_from_object
from scenegen.objects.sources import file_objects
from scenegen.rooms.preview import depth_bytes, id_colors, normal_bytes, srgb_bytes
from scenegen.rooms.reader import Room

Array = NDArray[Any]
MOST_TRIANGLES = 10_000  # of a mesh that is drawn as it is
CELLS = 40  # across a unit shape, of the grid that thins larger ones out
MESHES_KEPT = 64
ShapeOf = Callable[[PlacedObject], Array]  # triangles of its unit shape
FARTHEST = 1000.0  # scene units; browsers draw nothing beyond
RIGID_TOLERANCE = 1e-6  # by which R^T R may differ from the identity
COLORINGS = ("Image", "Depth", "Normal", "Object id")
GAP = 1.1  # between true and predicted surfels, in widths of the image
TOO_NEAR, RIGHT, TOO_FAR = (0, 80, 200), (222, 222, 222), (200, 30, 0)
UNKNOWN = (120, 0, 140)  # the truth has no depth there


@dataclass(frozen=True, eq=False)
class Surfels:
    """The surface points of one image: one for each of N pixels that has a depth.

    Attributes:
        points: (N, 3) float32, world frame, scene units.
        pixels: (N, 2), row and column of each point's pixel.
        spacing: side of a pixel at the median depth, scene units; 0 where there is no point.
    """

    points: Array
    pixels: Array
    spacing: float

    def of_pixels(self, values: Array) -> Array:
        """Return the values, (H, W, ...), of the points' pixels, (N, ...)."""
        return np.asarray(values[self.pixels[:, 0], self.pixels[:, 1]])


def has_surfel(depth: Array) -> Array:
    """Return which pixels of a planar depth map, in scene units, have a surfel: (...) bool.

    Their depth is finite, in front of the camera, and not beyond FARTHEST.
    """
    return np.asarray(np.isfinite(depth) & (depth > 0) & (depth <= FARTHEST))


def surfels_of(room: Room, predicted: Array | None = None) -> Surfels:
    """Return the surfels of a view, or of other points, (H, W, 3), camera frame, scene units."""
    image = room.points if predicted is None else predicted
    depth = -image[..., 2]
    seen = has_surfel(depth) & (np.abs(image) <= FARTHEST).all(axis=-1)
    points = image[seen]
    middle = float(np.median(depth[seen])) if len(points) else 0.0
    spacing = pixel_size(len(depth), room.fov_y_degrees) * middle
    points = transform_points(room.world_from_camera, points).astype(np.float32)
    return Surfels(points, np.argwhere(seen), spacing)


def check_camera(room: Room) -> None:
    """Raise FileFormatError unless a view's camera is a rotation and a shift, and has an angle."""
    rotation, fov = room.world_from_camera[:3, :3], room.fov_y_degrees
    rigid = np.isfinite(room.world_from_camera).all() and np.allclose(
        rotation.T @ rotation, np.eye(3), atol=RIGID_TOLERANCE
    )
    if not rigid or np.linalg.det(rotation) < 0:
        found = "a matrix that is no rotation and shift"
        raise FileFormatError(f"row {room.index}: world_from_camera", found, "a rigid transform")
    if not 0 < fov < 180:
        raise FileFormatError(f"row {room.index}: fov_y_degrees", fov, "between 0 and 180")


def pixel_colors(room: Room, coloring: str) -> Array:
    """Return a colour for each pixel, (H, W, 3) uint8, sRGB; `coloring` is one of COLORINGS.

    They are those of `scenegen preview`, but normals are in the world frame, so that a surface has
    one colour in all views.
    """
    if coloring == "Depth":
        return depth_bytes(room.depth)
    if coloring == "Normal":
        return normal_bytes(transform_vectors(room.world_from_camera, room.normal))
    if coloring == "Object id":
        return id_colors(room.object_id)
    return srgb_bytes(room.radiance)


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


def aside(room: Room) -> Array:
    """Return by how much a prediction is moved to the right of a view to be beside the truth, (3,).

    World frame, scene units: a little more than the width of what the view shows.
    """
    right = room.world_from_camera[:3, 0]
    across = surfels_of(room).points @ right
    width = float(np.ptp(across)) if len(across) else 1.0
    return np.asarray(GAP * width * right)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one colour.

    Attributes:
        object_id: k for the k-th object.
        triangles: corners, (F, 3, 3), world frame, counter-clockwise seen from outside.
        color: (3,) uint8, sRGB: its reflectance, or what pictures show of it.
    """

    object_id: int
    triangles: Array
    color: Array


def shapes_of(spec: Request, **folder: Any) -> ShapeOf:
    """Return the function that finds the triangles, (F, 3, 3), of an object's unit shape.

    `folder` are the options of `file_objects`. The function raises SpecError where the objects are
    meshes without a folder, or a model's file has changed, and BadMeshError for a model that cannot
    be used.

    Raises as `file_objects` where there is a folder.
    """
    has_folder = any(folder.get(name) for name in ("shapenet_root", "objects_root"))
    if spec.source not in BUILT_IN and not has_folder:

        def without_folder(_item: PlacedObject) -> Array:
            option = "--objects-root" if spec.source == "folder" else "--shapenet-root"
            raise SpecError("objects", f"meshes ({spec.source})", f"their folder, by {option}")

        return without_folder
    objects = file_objects(spec, **folder)
    drawn = lru_cache(MESHES_KEPT)(lambda name: thinned(objects.shape(name).triangles))

    def triangles_of(item: PlacedObject) -> Array:
        if objects.digest(item.shape) != item.mesh:
            raise SpecError(item.shape, "a file that has changed", "the one that was rendered")
        return np.asarray(drawn(item.shape))

    return triangles_of


def thinned(triangles: Array) -> Array:
    """Return fewer triangles, (F, 3, 3), of a unit shape that has more than MOST_TRIANGLES.

    Corners within one cell of a grid become their mean: they move by less than 0.09 of the shape's
    radius, and mostly along its surface.
    """
    if len(triangles) <= MOST_TRIANGLES:
        return triangles
    corners = triangles.reshape(-1, 3)
    # Corners that differ by rounding alone, as where a turned profile closes, are in one cell.
    cell = np.floor(np.round((corners + 1.0) * (CELLS / 2), 6)).astype(np.int64)
    number = cell @ (4 * CELLS * CELLS, 2 * CELLS, 1)
    _, place, count = np.unique(number, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(place, axis) for axis in corners.T], axis=1) / count[:, None]
    faces = place.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    # Each face begins at its lowest corner, so that equal faces are found.
    turned = np.take_along_axis(faces, (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    return np.asarray(means[np.unique(turned, axis=0)])


def scene_meshes(scene: SceneSpec, shape_of: ShapeOf) -> tuple[list[Mesh], list[str]]:
    """Return the objects of a scene, and why others are left out.

    An object is left out where `shape_of` raises SceneGenError; each reason is told once.
    """
    meshes, reasons = list[Mesh](), dict[str, None]()
    for k, item in enumerate(scene.objects, start=1):
        try:
            triangles = shape_of(item)
        except SceneGenError as error:
            reasons[str(error)] = None
            continue
        place = world_from_object(item.position, item.rotation, item.scale)
        color = srgb_bytes(np.array(item.reflectance))
        meshes.append(Mesh(k, transform_points(place, triangles), color))
    return meshes, list(reasons)


def pictured(meshes: Sequence[Mesh], rooms: Sequence[Room]) -> list[Mesh]:
    """Return the meshes of a scene, each in the mean colour of its pixels in all views.

    A mesh that no view shows keeps its own. Reflectances of closed rooms are constants, which
    textures replace.
    """
    ids = np.concatenate([room.object_id.ravel() for room in rooms])
    colors = np.concatenate([pixel_colors(room, "Image").reshape(-1, 3) for room in rooms])
    shown = [colors[ids == mesh.object_id] for mesh in meshes]
    return [
        replace(mesh, color=np.rint(some.mean(axis=0)).astype(np.uint8)) if len(some) else mesh
        for mesh, some in zip(meshes, shown, strict=True)
    ]


def hit_by(
    surfels: Surfels, origin: Array, direction: Array, angle: float = 0.0
) -> tuple[int, float] | None:
    """Return which surfel a ray from (3,) along the unit vector (3,) hits first, and how far off.

    A surfel is hit where the ray passes it by less than the side of a pixel, or by less than
    `angle` radians, seen from the ray's origin. None where no surfel is hit. viser picks meshes by
    itself, but no points of a cloud.
    """
    towards = surfels.points - origin
    along = towards @ direction
    beside = np.linalg.norm(towards - along[:, None] * direction, axis=1)
    reach = np.maximum(surfels.spacing, angle * along)
    near = np.flatnonzero((beside <= reach) & (along > 0))
    if not near.size:
        return None
    front = along[near].min()
    first = near[along[near] <= front + 2 * reach[near]]  # of one surface, the nearest to the ray
    chosen = first[np.argmin(beside[first])]
    return int(chosen), float(along[chosen])

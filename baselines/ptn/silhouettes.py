"""Silhouettes of a room's objects, from its image or, for the oracle variant, from the truth's ids.

The image's way uses what the model is told and no ids: the empty room is shaded with the known
camera, lights and reflectance of the walls, and a pixel that differs shows an object. This is exact
up to rounding, as the paper's shading equation knows no shadows and no light from other surfaces.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.trivial import empty_room
from scenegen.camera import back_project, transform_points, transform_vectors
from scenegen.common.errors import SpecError
from scenegen.rendering.ground_truth import decode_image
from scenegen.rendering.shading import shade
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
ROUNDING = {"uint8": 0.75 / 255, "float16": 2e-3, "float32": 1e-4}  # of the stored radiance


def check_shading(rooms: RoomsFile) -> None:
    """Raise SpecError where objects change the light on the walls, or samples blend edges."""
    spec = rooms.spec
    if spec.shading != "paper" or spec.shadows or spec.spp > 1:
        raise SpecError(
            rooms.path,
            "images with shadows, indirect light or several samples per pixel",
            "the paper's shading, in which a pixel unlike the empty room's shows an object",
            "take silhouettes from ids, which is the oracle variant",
        )


def silhouette(rooms: RoomsFile, row: int, source: str = "image") -> Array:
    """Return whether each pixel of an image shows an object, (H, W) booleans.

    Args:
        source: "image" for the difference from the empty room, "ids" for the truth.
    """
    if source == "ids":
        return np.asarray(rooms.read("object_id", row) > 0)
    empty = empty_radiance(rooms, row)
    stored = decode_image(rooms.read("image", row))
    if rooms.spec.image_dtype == "uint8":
        empty = np.clip(empty, 0.0, 1.0)
    return np.asarray((np.abs(stored - empty) > ROUNDING[rooms.spec.image_dtype]).any(axis=-1))


def empty_radiance(rooms: RoomsFile, row: int) -> Array:
    """Return the linear radiance of the room without its objects, (H, W, 3)."""
    pose = rooms.read("camera/world_from_camera", row)
    depth, normal = empty_room(rooms, row)
    count = int(rooms.read("light/count", row))
    return shade(
        transform_points(pose, back_project(depth, float(rooms.read("camera/fov_y_degrees", row)))),
        transform_vectors(pose, normal),
        rooms.read("material/reflectance", row)[0],
        rooms.read("light/position", row)[:count],
        rooms.read("light/color", row)[:count],
        rooms.read("light/ambient", row),
        rooms.read("light/attenuation", row),
    )

"""Many scenes as one batch of arrays: what the wavefront reads.

Each object is cast in its own frame, where its unit shape lies in a structure that is built once.
So scenes need no lattice and no space between them: a ray meets no object but its own scene's, by
construction, and an image's bits cannot depend on the rest of its batch.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.errors import SpecError
from scenegen.records import check
from scenegen.shapes import rotation_matrix
from scenegen.specs import DatasetSpec, SceneSpec

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class SceneBatch:
    """B images, each with K object slots and L light slots (unused ones have radius or colour 0).

    Attributes:
        spec: gives image size, sample count, shadows, and K, L and the shapes.
        world_from_camera: (B, 4, 4).
        fov_y_degrees: (B,).
        object_count, light_count: (B,) integers.
        shape: index into spec.shapes, (B, K); -1 for an unused slot.
        world_from_object: (B, K, 4, 4) similarities; zero for an unused slot.
        object_scale: (B, K) bounding radius, scene units.
        reflectance: rho by object id, (B, 1 + K, 3); [:, 0] is the room's.
        light_position, light_color: (B, L, 3), world.
        ambient: (B, 3).
        has_room: (B,) bool.
        background: radiance of rays that meet nothing, (B, 3).
        attenuation: (k_l, k_q), (B, 2).
        blocks: whether each image shows boxes only, of one size and orientation, and no room; they
            are then cast faster, to the same truth within rounding. It is said, not found out, so
            that an image's bits cannot depend on the rest of its batch.
    """

    spec: DatasetSpec
    world_from_camera: Array
    fov_y_degrees: Array
    object_count: Array
    light_count: Array
    shape: Array
    world_from_object: Array
    object_scale: Array
    reflectance: Array
    light_position: Array
    light_color: Array
    ambient: Array
    attenuation: Array
    has_room: Array
    background: Array
    blocks: bool = False

    def __len__(self) -> int:
        return len(self.fov_y_degrees)


def pack(spec: DatasetSpec, scenes: Sequence[SceneSpec], view_index: int = 0) -> SceneBatch:
    """Gather one view of each scene into arrays.

    Raises SpecError where a scene has more objects or lights, or other shapes, than `spec` allows,
    or has no such view.
    """
    batch, slots, light_slots = len(scenes), spec.object_slots, spec.light_slots
    objects = [item for scene in scenes for item in scene.objects]
    lights = [light for scene in scenes for light in scene.lights]
    object_count = np.array([len(scene.objects) for scene in scenes], np.int32)
    light_count = np.array([len(scene.lights) for scene in scenes], np.int32)
    for name, count, most in (
        ("objects", object_count, spec.objects[1]),
        ("lights", light_count, spec.lights[1]),
    ):
        if count.max(initial=0) > most:
            worst = scenes[int(count.argmax())].index
            raise SpecError(f"scene {worst}: found {count.max()} {name}, the spec allows {most}")
    for scene in scenes:
        views = f"a view from 0 to {len(scene.cameras) - 1}"
        check(0 <= view_index < len(scene.cameras), f"scene {scene.index}", view_index, views)
    unknown = {item.shape for item in objects} - set(spec.shapes)
    if unknown:
        raise SpecError(f"scene shapes: found {sorted(unknown)}, the spec has {spec.shapes}")

    used = np.arange(slots) < object_count[:, None]
    shape = np.full((batch, slots), -1, np.int8)
    shape[used] = [spec.shapes.index(item.shape) for item in objects]
    scale = np.zeros((batch, slots))
    scale[used] = [item.scale for item in objects]
    placed = np.zeros((len(objects), 4, 4))
    if objects:
        rotation = np.stack([rotation_matrix(item.rotation) for item in objects])
        placed[:, :3, :3] = scale[used][:, None, None] * rotation
        placed[:, :3, 3] = [item.position for item in objects]
        placed[:, 3, 3] = 1.0
    world_from_object = np.zeros((batch, slots, 4, 4))
    world_from_object[used] = placed
    reflectance = np.zeros((batch, 1 + slots, 3))
    reflectance[:, 0] = [scene.room_reflectance or (0.0, 0.0, 0.0) for scene in scenes]
    reflectance[:, 1:][used] = np.array([i.reflectance for i in objects]).reshape(-1, 3)

    lit = np.arange(light_slots) < light_count[:, None]
    light_position = np.zeros((batch, light_slots, 3))
    light_position[lit] = np.array([light.position for light in lights]).reshape(-1, 3)
    light_color = np.zeros((batch, light_slots, 3))
    light_color[lit] = np.array([light.color for light in lights]).reshape(-1, 3)
    cameras = [scene.cameras[view_index] for scene in scenes]
    return SceneBatch(
        spec=spec,
        world_from_camera=np.stack([camera.world_from_camera for camera in cameras]),
        fov_y_degrees=np.array([camera.fov_y_degrees for camera in cameras]),
        object_count=object_count,
        light_count=light_count,
        shape=shape,
        world_from_object=world_from_object,
        object_scale=scale,
        reflectance=reflectance,
        light_position=light_position,
        light_color=light_color,
        ambient=np.array([scene.ambient for scene in scenes]),
        attenuation=np.array([scene.attenuation for scene in scenes]),
        has_room=np.array([scene.room_reflectance is not None for scene in scenes]),
        background=np.array([scene.background for scene in scenes]),
    )


def pixel_size(fov_y_degrees: Array, height: int) -> Array:
    """Return the side of a pixel at depth 1, (B,), scene units."""
    return np.asarray(2 * np.tan(np.asarray(fov_y_degrees) * (math.pi / 360)) / height)

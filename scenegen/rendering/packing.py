"""Pack many views of many scenes into one batch of arrays, the input of the renderers.

Each object is cast in its own frame, against a structure of its unit shape that is built once. So
the scenes of a batch need not be placed apart: a ray can only hit objects of its own scene, and an
image's bits cannot depend on the rest of its batch.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SpecError
from scenegen.common.rotations import rotation_matrix
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class SceneBatch:
    """B images, each with K object slots and L light slots (unused ones have radius or colour 0).

    Attributes:
        spec: the data set's spec: image size, sample count, shadows, K, L and the shapes.
        index, view: number of each image's scene, and of the view in it, (B,) integers.
        world_from_camera: (B, 4, 4).
        fov_y_degrees: (B,).
        object_count, light_count: (B,) integers.
        names: the objects' names, as in `scenes.PlacedObject.shape`, each once.
        shape_of: returns the unit shape of a name.
        shape: index into `names`, (B, K); -1 for an unused slot.
        world_from_object: (B, K, 4, 4) similarities; zero for an unused slot.
        object_scale: (B, K) bounding radius, scene units.
        reflectance: rho by object id, (B, 1 + K, 3); [:, 0] is the room's.
        gloss: Phong's k_s and exponent by object id, (B, 1 + K, 2).
        light_position, light_color: (B, L, 3), world.
        ambient: (B, 3).
        has_room: (B,) bool.
        background: radiance of rays that hit nothing, (B, 3).
        attenuation: (k_l, k_q), (B, 2).
        cubes_only: whether each image shows only boxes of one size and orientation, and no room.
            They are then cast faster, with the same result within rounding. The caller sets it, so
            that an image's bits cannot depend on the rest of its batch.
    """

    spec: DatasetSpec
    names: tuple[str, ...]
    shape_of: Callable[[str], UnitShape]
    index: Array
    view: Array
    world_from_camera: Array
    fov_y_degrees: Array
    object_count: Array
    light_count: Array
    shape: Array
    world_from_object: Array
    object_scale: Array
    reflectance: Array
    gloss: Array
    light_position: Array
    light_color: Array
    ambient: Array
    attenuation: Array
    has_room: Array
    background: Array
    cubes_only: bool = False

    def __len__(self) -> int:
        return len(self.fov_y_degrees)

    def rows(self, start: int, end: int) -> "SceneBatch":
        """Return the images start .. end - 1, with only the names that they need."""
        arrays: dict[str, Any] = {
            field.name: value[start:end]
            for field in fields(self)
            if isinstance(value := getattr(self, field.name), np.ndarray)
        }
        used, shape = np.unique(arrays["shape"], return_inverse=True)
        names = tuple(self.names[i] for i in used.tolist() if i >= 0)
        arrays["shape"] = (shape.reshape(arrays["shape"].shape) - int(used[0] < 0)).astype(np.int32)
        return replace(self, names=names, **arrays)


def pack(
    spec: DatasetSpec,
    scenes: Sequence[SceneSpec],
    views: Sequence[int] = (0,),
    objects: Objects | None = None,
) -> SceneBatch:
    """Pack these views of each scene into arrays, scene after scene.

    Raises SpecError where a scene has more objects or lights, or other shapes, than `spec` allows,
    or lacks one of the views.
    """
    batch, slots, light_slots = len(scenes), spec.object_slots, spec.light_slots
    items = [item for scene in scenes for item in scene.objects]
    lights = [light for scene in scenes for light in scene.lights]
    object_count = np.array([len(scene.objects) for scene in scenes], np.int32)
    light_count = np.array([len(scene.lights) for scene in scenes], np.int32)
    for name, count, most in (
        ("objects", object_count, spec.objects[1]),
        ("lights", light_count, spec.lights[1]),
    ):
        if count.max(initial=0) > most:
            worst = scenes[int(count.argmax())].index
            raise SpecError(f"scene {worst}", f"{count.max()} {name}", f"at most {most}")
    for scene in scenes:
        if not 0 <= min(views) <= max(views) < len(scene.cameras):
            known = f"views from 0 to {len(scene.cameras) - 1}"
            raise SpecError(f"scene {scene.index}", ", ".join(map(str, views)), known)
    unknown = {item.name for item in items} - set(spec.shapes)
    if unknown:
        raise SpecError("scene shapes", sorted(unknown), f"some of {spec.shapes}")
    # All basic shapes are listed, used or not, so that their Mitsuba scene is built only once.
    basic = spec.source == "shapes"
    names = spec.shapes if basic else tuple(sorted({item.shape for item in items}))
    number = {name: i for i, name in enumerate(names)}

    used = np.arange(slots) < object_count[:, None]
    shape = np.full((batch, slots), -1, np.int32)
    shape[used] = [number[item.shape] for item in items]
    scale = np.zeros((batch, slots))
    scale[used] = [item.scale for item in items]
    placed = np.zeros((len(items), 4, 4))
    if items:
        rotation = np.stack([rotation_matrix(item.rotation) for item in items])
        placed[:, :3, :3] = scale[used][:, None, None] * rotation
        placed[:, :3, 3] = [item.position for item in items]
        placed[:, 3, 3] = 1.0
    world_from_object = np.zeros((batch, slots, 4, 4))
    world_from_object[used] = placed
    reflectance = np.zeros((batch, 1 + slots, 3))
    reflectance[:, 0] = [scene.room_reflectance or (0.0, 0.0, 0.0) for scene in scenes]
    reflectance[:, 1:][used] = np.array([i.reflectance for i in items]).reshape(-1, 3)
    gloss = np.zeros((batch, 1 + slots, 2))
    gloss[..., 1] = 1.0
    gloss[:, 1:][used] = np.array([(i.specular, i.shininess) for i in items]).reshape(-1, 2)

    lit = np.arange(light_slots) < light_count[:, None]
    light_position = np.zeros((batch, light_slots, 3))
    light_position[lit] = np.array([light.position for light in lights]).reshape(-1, 3)
    light_color = np.zeros((batch, light_slots, 3))
    light_color[lit] = np.array([light.color for light in lights]).reshape(-1, 3)
    cameras = [scene.cameras[view] for scene in scenes for view in views]

    def each(values: Array) -> Array:
        """Repeat what the views of a scene share."""
        return np.repeat(values, len(views), axis=0)

    return SceneBatch(
        spec=spec,
        names=names,
        shape_of=(objects or objects_of(spec)).shape,
        index=each(np.array([scene.index for scene in scenes], np.int64)),
        view=np.tile(np.array(views, np.int32), batch),
        world_from_camera=np.stack([camera.world_from_camera for camera in cameras]),
        fov_y_degrees=np.array([camera.fov_y_degrees for camera in cameras]),
        object_count=each(object_count),
        light_count=each(light_count),
        shape=each(shape),
        world_from_object=each(world_from_object),
        object_scale=each(scale),
        reflectance=each(reflectance),
        gloss=each(gloss),
        light_position=each(light_position),
        light_color=each(light_color),
        ambient=each(np.array([scene.ambient for scene in scenes])),
        attenuation=each(np.array([scene.attenuation for scene in scenes])),
        has_room=each(np.array([scene.room_reflectance is not None for scene in scenes])),
        background=each(np.array([scene.background for scene in scenes])),
    )

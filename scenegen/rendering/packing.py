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

from scenegen.camera import Lens, look_at, pixel_directions
from scenegen.common.errors import SpecError
from scenegen.common.records import check, to_json
from scenegen.common.rotations import rotation_matrix
from scenegen.description.scene_arrays import SceneArrays
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import Request
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
        interior: closed rooms as JSON, (B,) texts, empty for others; None where there are none.
        cubes_only: whether each image shows only boxes of one size and orientation, and no room.
            They are then cast faster, with the same result within rounding. The caller sets it:
            an image's bits must not depend on the rest of its batch.
    """

    spec: Request
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
    interior: Array | None = None
    cubes_only: bool = False

    def __len__(self) -> int:
        return len(self.fov_y_degrees)

    def lens(self, image: int) -> Lens:
        """Return the lens of an image."""
        return self.spec.lens(float(self.fov_y_degrees[image]))

    @property
    def pixel_heights(self) -> Array:
        """Height of the pixels of each image on the plane at depth 1, (B,); 0 in panoramas."""
        size = self.spec.height, self.spec.width
        lenses = map(self.lens, range(len(self)))
        return np.array([lens.grid(*size).down if lens.is_flat else 0.0 for lens in lenses])

    @property
    def directions(self) -> Array | None:
        """Directions of the pixels of panoramas, all alike, (H W, 3); None for other images."""
        lens = self.lens(0)
        if lens.is_flat:
            return None
        return pixel_directions(self.spec.height, self.spec.width, lens).reshape(-1, 3)

    def rows(self, which: Any) -> "SceneBatch":
        """Return some images, by a slice or their numbers, with only the models that they need."""
        arrays: dict[str, Any] = {
            field.name: value[which]
            for field in fields(self)
            if isinstance(value := getattr(self, field.name), np.ndarray)
        }
        if self.spec.source == "shapes":  # listed, used or not: so their scene is built only once
            return replace(self, **arrays)
        used, shape = np.unique(arrays["shape"], return_inverse=True)
        names = tuple(self.names[i] for i in used.tolist() if i >= 0)
        arrays["shape"] = (shape.reshape(arrays["shape"].shape) - int(used[0] < 0)).astype(np.int32)
        return replace(self, names=names, **arrays)


def pack(
    spec: Request,
    scenes: Sequence[SceneSpec],
    views: Sequence[int] = (0,),
    objects: Objects | None = None,
) -> SceneBatch:
    """Pack these views of each scene into arrays, scene after scene.

    Raises SpecError where a scene has more objects or lights, or other shapes, than `spec` allows,
    lacks one of the views, or has a camera that looks straight up or down.
    """
    for scene in scenes:
        for name, most in (("objects", spec.objects[1]), ("lights", spec.lights[1])):
            count = len(getattr(scene, name))
            check(count <= most, f"scene {scene.index}", f"{count} {name}", f"at most {most}")
        if not 0 <= min(views) <= max(views) < len(scene.cameras):
            possible = f"views from 0 to {len(scene.cameras) - 1}"
            raise SpecError(f"scene {scene.index}", ", ".join(map(str, views)), possible)
    unknown = {item.name for scene in scenes for item in scene.objects} - set(spec.shapes)
    if unknown:
        raise SpecError("scene shapes", sorted(unknown), f"some of {spec.shapes}")
    return pack_arrays(spec, _arrays(spec, scenes, views), views, objects)


def pack_arrays(
    spec: Request, scenes: SceneArrays, views: Sequence[int], objects: Objects | None = None
) -> SceneBatch:
    """Pack all views of each scene into arrays, scene after scene; their numbers are `views`.

    Raises SpecError where a camera looks straight up or down.
    """
    count, slots = scenes.shape.shape
    world_from_camera = look_at(scenes.camera_position, scenes.camera_target)
    vertical = np.isnan(world_from_camera).any(axis=(1, 2, 3))
    if vertical.any():
        expected = "a direction of view that is not vertical"
        raise SpecError(
            f"scene {scenes.index[vertical][0]}", "a camera that looks along y", expected
        )
    world_from_object = np.zeros((count, slots, 4, 4))
    turned = rotation_matrix(np.moveaxis(scenes.rotation, -1, 0))
    world_from_object[..., :3, :3] = scenes.scale[..., None, None] * turned
    world_from_object[..., :3, 3] = scenes.position
    world_from_object[..., 3, 3] = scenes.shape >= 0
    has_room = np.asarray(~np.isnan(scenes.room_reflectance).any(axis=1))
    room = np.where(has_room[:, None], scenes.room_reflectance, 0.0)
    matte = np.broadcast_to((0.0, 1.0), (count, 1, 2))

    def each(values: Array) -> Array:
        """Repeat what the views of a scene share."""
        return np.repeat(values, len(views), axis=0)

    batch = SceneBatch(
        spec=spec,
        names=tuple(scenes.names),
        shape_of=(objects or objects_of(spec)).shape,
        index=each(scenes.index),
        view=np.tile(np.array(views, np.int32), count),
        world_from_camera=world_from_camera.reshape(-1, 4, 4),
        fov_y_degrees=scenes.fov_y_degrees.reshape(-1),
        object_count=each(scenes.object_count),
        light_count=each(scenes.light_count),
        shape=each(scenes.shape),
        world_from_object=each(world_from_object),
        object_scale=each(scenes.scale),
        reflectance=each(np.concatenate([room[:, None], scenes.reflectance], axis=1)),
        gloss=each(np.concatenate([matte, scenes.gloss], axis=1)),
        light_position=each(scenes.light_position),
        light_color=each(scenes.light_color),
        ambient=each(scenes.ambient),
        attenuation=each(scenes.attenuation),
        has_room=each(has_room),
        background=each(scenes.background),
        interior=each(scenes.interior) if spec.interior else None,
    )
    return batch.rows(slice(None))


def _arrays(spec: Request, scenes: Sequence[SceneSpec], views: Sequence[int]) -> SceneArrays:
    """Return scenes as arrays, with these views alone."""
    shown = {item.shape for scene in scenes for item in scene.objects}
    names = spec.shapes if spec.source == "shapes" else tuple(sorted(shown))
    number = {name: i for i, name in enumerate(names)}
    objects = [
        [
            (number[item.shape], item.mesh, item.position, item.rotation, item.scale,
             item.reflectance, (item.specular, item.shininess))
            for item in scene.objects
        ]
        for scene in scenes
    ]  # fmt: skip
    lights = [[(light.position, light.color) for light in scene.lights] for scene in scenes]
    cameras = [[scene.cameras[view] for view in views] for scene in scenes]
    shape, mesh, position, rotation, scale, reflectance, gloss = _slots(
        objects, spec.object_slots, (-1, "", (0.0,) * 3, (0.0,) * 4, 0.0, (0.0,) * 3, (0.0, 1.0))
    )
    light_position, light_color = _slots(lights, spec.light_slots, ((0.0,) * 3, (0.0,) * 3))
    return SceneArrays(
        names=names,
        index=np.array([scene.index for scene in scenes], np.int64),
        camera_position=np.array([[c.position for c in row] for row in cameras], float),
        camera_target=np.array([[c.target for c in row] for row in cameras], float),
        fov_y_degrees=np.array([[c.fov_y_degrees for c in row] for row in cameras], float),
        object_count=np.array([len(row) for row in objects], np.int32),
        shape=shape.astype(np.int32),
        mesh=mesh.astype(object),
        position=position,
        rotation=rotation,
        scale=scale,
        reflectance=reflectance,
        gloss=gloss,
        light_count=np.array([len(row) for row in lights], np.int32),
        light_position=light_position,
        light_color=light_color,
        ambient=np.array([scene.ambient for scene in scenes], float),
        attenuation=np.array([scene.attenuation for scene in scenes], float),
        room_reflectance=np.array(
            [scene.room_reflectance or (np.nan,) * 3 for scene in scenes], float
        ),
        background=np.array([scene.background for scene in scenes], float),
        interior=np.array([to_json(s.interior) if s.interior else "" for s in scenes], object),
    )


def _slots(rows: list[list[Any]], slots: int, empty: tuple[Any, ...]) -> list[Array]:
    """Return each part of the rows' entries as (S, slots, ...), filled up with `empty`."""
    filled = [entry for row in rows for entry in [*row, *[empty] * (slots - len(row))]]
    columns = [np.array(column) for column in zip(*filled, strict=True)]
    return [column.reshape(len(rows), slots, *column.shape[1:]) for column in columns]

"""All pixels of a batch in one Dr.Jit kernel: colour, depth, normal and object id.

`launch_pixels` uploads the scenes, starts the kernel, and returns a function that fetches the
pixels. The camera rays start here; `rays` (or `cubes`) finds what they hit.
"""

from collections.abc import Callable, Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_size
from scenegen.objects.exact_surfaces import Surface
from scenegen.rendering.cubes import Cubes, closest_cube, upload_cubes
from scenegen.rendering.model_scene import model_scene
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.pixel_samples import SAMPLE_STEPS
from scenegen.rendering.rays import (
    BEFORE_LIGHTS,
    OBJECT,
    Scenes,
    closest_hit,
    normal_at,
    radiance_at,
)
from scenegen.rendering.surfaces.in_kernel import upload_surfaces
from scenegen.rendering.tables import gather_row, upload_table
from scenegen.rendering.unit_scene import unit_scene

Array = NDArray[Any]
LANES = 32  # an image's rays are padded to a multiple of this, so no SIMD packet spans two images


def launch_pixels(
    batch: SceneBatch, variant: str, fields: Sequence[str]
) -> Callable[[], dict[str, Array]]:
    """Start the kernel; the returned function waits for it and returns the pixels by field.

    Only what is needed for these fields of `GroundTruth` is computed.
    """
    scenes, cameras = upload_scenes(batch, variant)
    cubes = upload_cubes(batch) if batch.cubes_only else None
    everything = _trace(batch, scenes, cameras, cubes)
    components = {name: everything[name] for name in fields}
    dr.eval(components)
    spec, count = batch.spec, len(batch)

    def pixels(name: str) -> Array:
        # Vectors are fetched by component: to interleave them on the device takes scattered writes.
        planes = [channel.numpy().reshape(count, -1) for channel in components[name]]
        values = np.empty((count, spec.height * spec.width, len(planes)), planes[0].dtype)
        for i, plane in enumerate(planes):
            values[..., i] = plane[:, : values.shape[1]]
        channels = (len(planes),) if len(planes) > 1 else ()
        return values.reshape(count, spec.height, spec.width, *channels)

    return lambda: {name: pixels(name) for name in fields}


def upload_scenes(batch: SceneBatch, variant: str) -> tuple[Scenes, Any]:
    """Return the scenes on the device, and the cameras, (B, 13): world_from_camera, pixel size."""
    spec, count = batch.spec, len(batch)
    surfaces: list[Surface | None] = [None]
    if spec.source == "shapes":
        shapes = [batch.shape_of(name) for name in batch.names]
        unit, surfaces = unit_scene(variant, tuple(shapes)), [shape.surface for shape in shapes]
    else:  # made by nobody where they are in the cache
        unit = model_scene(variant, batch.shape_of, batch.names)
    mi.set_variant(variant)
    exact = upload_surfaces(surfaces)
    shape = np.maximum(batch.shape, 0)
    center = batch.world_from_object[..., :3, 3]
    squared = np.where(batch.shape >= 0, batch.object_scale, 1.0)[..., None, None] ** 2
    # The inverse of a similarity s R is its transpose over s squared.
    linear = np.swapaxes(batch.world_from_object[..., :3, :3], -1, -2) / squared
    objects = np.zeros((count, spec.object_slots, 4 * OBJECT))
    objects[..., :3], objects[..., 3] = center, batch.object_scale
    into = objects[..., 4:16].reshape(count, -1, 3, 4)  # a view
    into[..., :3], into[..., 3] = linear, -np.einsum("bkij,bkj->bki", linear, center)
    objects[..., 16:19] = exact.record[shape % len(exact.record)]
    objects[..., 20:23], objects[..., 23] = unit.offset[shape], unit.first_triangle[shape]
    about = np.zeros((count, BEFORE_LIGHTS + 6 * spec.light_slots))
    about[:, :3], about[:, 3:5] = batch.ambient, batch.attenuation
    about[:, 5], about[:, 6], about[:, 8:11] = batch.has_room, batch.object_count, batch.background
    lights = np.concatenate([batch.light_position, batch.light_color], axis=-1)
    about[:, BEFORE_LIGHTS:] = lights.reshape(count, -1)
    glossy = spec.specular[1] > 0
    materials = [batch.reflectance, batch.gloss] if glossy else [batch.reflectance]
    pixel = np.array([pixel_size(spec.height, fov) for fov in batch.fov_y_degrees.tolist()])
    camera = [batch.world_from_camera[:, :3].reshape(count, 12), pixel[:, None]]
    scenes = Scenes(
        unit=unit.scene,
        grid=unit.grid,
        slots=spec.object_slots,
        light_slots=spec.light_slots,
        surfaces=exact,
        triangles=unit.normals,
        objects=upload_table(objects),
        scenes=upload_table(about),
        materials=upload_table(np.concatenate(materials, axis=-1)),
        glossy=glossy,
    )
    return scenes, upload_table(np.concatenate(camera, axis=1))


def _cast(kind: Any, values: Any) -> Any:
    """Convert to one of Dr.Jit's computed types; its stubs do not say that these are callable."""
    return kind(values)


def _trace(
    batch: SceneBatch, scenes: Scenes, cameras: Any, cubes: Cubes | None
) -> dict[str, list[Any]]:
    """Return the components of the fields of `GroundTruth` for every ray, not yet evaluated."""
    spec = batch.spec
    height, width = spec.height, spec.width
    rays = -(-height * width // LANES) * LANES
    index = dr.arange(mi.UInt32, len(batch) * rays)
    item = index // rays
    pixel = dr.minimum(index - item * rays, height * width - 1)
    row = pixel // width
    column = pixel - row * width
    camera = gather_row(cameras, item, 13)
    right, up, back, origin = (mi.Vector3f(*camera[i:12:4]) for i in range(4))

    def direction(x: Any, y: Any) -> Any:
        """Return the world direction through the image point (x, y), in pixels; camera z is -1."""
        return right * ((x - width / 2) * camera[12]) + up * ((height / 2 - y) * camera[12]) - back

    def hit(d: Any) -> tuple[Any, Any, Any, Any]:
        if cubes:
            t, object_id, n = closest_cube(cubes, item, origin, d)
            return t, object_id, origin + dr.select(object_id >= 0, t, 0) * d, n
        t, object_id, face, uv = closest_hit(scenes, item, origin, d)
        p = origin + dr.select(object_id >= 0, t, 0) * d
        return t, object_id, p, normal_at(scenes, item, p, d, object_id, face, uv)

    d = direction(mi.Float(column) + 0.5, mi.Float(row) + 0.5)
    t, object_id, p, n = hit(d)
    image = radiance_at(scenes, item, p, d, n, object_id, spec.shadows)

    def add_sample(sample: Any, total: Any) -> tuple[Any, Any]:
        """Add the colour at one of `pixel_samples.sample_positions` other than the centre."""
        mirrored = (sample & 1) == 1
        x, y = (0.5 + mi.Float(sample // 2 + 1) * step for step in SAMPLE_STEPS)
        x, y = (dr.select(mirrored, 1 - (f - dr.floor(f)), f - dr.floor(f)) for f in (x, y))
        d = direction(mi.Float(column) + x, mi.Float(row) + y)
        _, object_id, p, n = hit(d)
        return sample + 1, total + radiance_at(scenes, item, p, d, n, object_id, spec.shadows)

    if spec.spp > 1:
        others = spec.spp // 2 * 2
        state = (mi.UInt32(0), image if spec.spp % 2 else mi.Vector3f(0))
        more = lambda sample, total: sample < others  # noqa: E731
        _, total = dr.while_loop(state, more, add_sample, mode="symbolic")
        image = total / spec.spp
    if spec.image_dtype == "uint8":
        image = _cast(dr.uint8_array_t(mi.Vector3f), dr.round(dr.clip(image, 0, 1) * 255))
    elif spec.image_dtype == "float16":
        image = _cast(dr.float16_array_t(mi.Vector3f), image)
    normal = mi.Vector3f(dr.dot(n, right), dr.dot(n, up), dr.dot(n, back))
    return {
        "image": list(image),
        "depth": [dr.select(object_id >= 0, t, dr.nan)],
        "normal": list(normal),
        "object_id": [_cast(dr.int8_array_t(mi.Float), object_id)],
    }

"""All pixels of a batch in one Dr.Jit kernel: colour, depth, normal and object id.

`launch_pixels` uploads the scenes, starts the kernel, and returns a function that fetches the
pixels. The camera rays start here; `rays` (or `cubes`) finds what they hit.
"""

from collections.abc import Callable, Collection, Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Grid
from scenegen.common.rotations import product
from scenegen.description.specs import Request
from scenegen.objects.cast_meshes import normal_table
from scenegen.objects.catalogue import mesh_to_cast
from scenegen.objects.exact_surfaces import Surface
from scenegen.objects.solids import Mesh
from scenegen.rendering.cubes import Cubes, closest_cube, upload_cubes
from scenegen.rendering.device_pixels import DeviceImage
from scenegen.rendering.ground_truth import KEPT
from scenegen.rendering.meshes.model_scene import GRID, model_scene
from scenegen.rendering.meshes.rasteriser import (
    Triangles,
    color_of_nearest,
    nearest_triangle,
    rasterise,
    ray_of,
    upload_triangles,
)
from scenegen.rendering.meshes.unit_scene import UnitScene, stacked, unit_scene
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.pixel_samples import SAMPLE_STEPS
from scenegen.rendering.rays import (
    BEFORE_LIGHTS,
    OBJECT,
    Scenes,
    closest_hit,
    nearer_than_room,
    normals_at,
    radiance_at,
    reflectance_at,
    visible_normal,
)
from scenegen.rendering.surfaces.in_kernel import upload_surfaces
from scenegen.rendering.tables import gather_row, upload_rows, upload_table

Array = NDArray[Any]
LANES = 32  # an image's rays are padded to a multiple of this, so no SIMD packet spans two images


def launch_pixels(
    batch: SceneBatch, variant: str, fields: Sequence[str], kept: Collection[str] = ()
) -> Callable[[], dict[str, Array]]:
    """Start the kernel; the returned function waits for it and returns the pixels by field.

    Only what is needed for these fields of `GroundTruth` is computed. As to those that are `kept`,
    see `renderer.launch_fields`.
    """
    meshes = None
    shown = batch.names if batch.spec.source != "shapes" else ()
    models = [mesh_to_cast(batch.shape_of, name) for name in shown]
    scenes, cameras = upload_scenes(batch, variant, models)
    cubes = upload_cubes(batch) if batch.cubes_only else None
    if batch.spec.source != "shapes":
        meshes = upload_triangles(batch, models, padded_rays(batch.spec))
    colors = None
    if batch.spec.own_reflectance:
        own = [batch.shape_of(name).colors.reshape(-1, 9) for name in shown]
        colors = upload_rows([np.ones((0, 9)), *own])[0]
    sampled = "image" in fields and batch.spec.spp > 1
    everything = _trace(batch, scenes, cameras, cubes, meshes, colors, sampled)
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

    def images(name: str) -> Array:
        firsts = range(0, count * padded_rays(spec), padded_rays(spec))
        of_all = components[name]
        return np.array([DeviceImage(of_all, i, spec.height, spec.width) for i in firsts], object)

    def fetch() -> dict[str, Array]:
        fetched = [name for name in fields if name not in kept or name == "object_id"]
        on_device = {KEPT + name: images(name) for name in fields if name in kept}
        return {name: pixels(name) for name in fetched} | on_device

    return fetch


def upload_scenes(
    batch: SceneBatch, variant: str, models: Sequence[Mesh], bounced: bool = False
) -> tuple[Scenes, Any]:
    """Return the scenes on the device, and the cameras, (B, 13): world_from_camera, pixel height.

    `models` are those of the batch's names, unless these are basic shapes. If rays are `bounced`
    off models, `rays.closest_hit` meets these, too.
    """
    spec, count = batch.spec, len(batch)
    surfaces: list[Surface | None] = [None]
    if spec.source == "shapes":
        shapes = [batch.shape_of(name) for name in batch.names]
        unit, surfaces = unit_scene(variant, tuple(shapes)), [shape.surface for shape in shapes]
    else:
        tree, offset, normals = None, np.zeros((max(1, len(models)), 3)), None
        first = np.zeros(len(offset), np.uint32)
        if spec.shadows or bounced:
            tree, offset = model_scene(variant, batch.shape_of, batch.names, models)
        if bounced:
            first, normals = stacked([normal_table(batch.shape_of(x)) for x in batch.names])
        unit = UnitScene(tree, offset, first, GRID, normals, None)
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
    into[..., :3], into[..., 3] = linear, -product(linear, center[..., None])[..., 0]
    objects[..., 16:19] = exact.record[shape % len(exact.record)]
    objects[..., 20:23], objects[..., 23] = unit.offset[shape], unit.first_triangle[shape]
    about = np.zeros((count, BEFORE_LIGHTS + 6 * spec.light_slots))
    about[:, :3], about[:, 3:5] = batch.ambient, batch.attenuation
    about[:, 5], about[:, 6], about[:, 8:11] = batch.has_room, batch.object_count, batch.background
    lights = np.concatenate([batch.light_position, batch.light_color], axis=-1)
    about[:, BEFORE_LIGHTS:] = lights.reshape(count, -1)
    glossy = spec.specular[1] > 0
    materials = [batch.reflectance, batch.gloss] if glossy else [batch.reflectance]
    camera = [batch.world_from_camera[:, :3].reshape(count, 12), batch.pixel_heights[:, None]]
    scenes = Scenes(
        unit=unit.scene,
        grid=unit.grid,
        slots=spec.object_slots,
        light_slots=spec.light_slots,
        surfaces=exact,
        normals=unit.normals,
        corners=unit.corners,
        objects=upload_table(objects),
        scenes=upload_table(about),
        materials=upload_table(np.concatenate(materials, axis=-1)),
        glossy=glossy,
    )
    return scenes, upload_table(np.concatenate(camera, axis=1))


def _converted(kind: Any, values: Any) -> Any:
    """Convert to one of Dr.Jit's computed types; its stubs do not say that these are callable."""
    return kind(values)


def padded_rays(spec: Request) -> int:
    """Return the number of rays of an image, padded to a multiple of LANES."""
    return -(-spec.height * spec.width // LANES) * LANES


def _trace(
    batch: SceneBatch,
    scenes: Scenes,
    cameras: Any,
    cubes: Cubes | None,
    meshes: Triangles | None,
    colors: Any,
    sampled: bool,
) -> dict[str, list[Any]]:
    """Return the components of the fields of `GroundTruth` for every ray, not yet evaluated.

    `colors` are those of the corners of all triangles, (F, 9), or None. The image is the mean of
    the spec's samples if it is `sampled`.
    """
    spec = batch.spec
    height, width, rays = spec.height, spec.width, padded_rays(spec)
    index = dr.arange(mi.UInt32, len(batch) * rays)
    item = index // rays
    pixel = dr.minimum(index - item * rays, height * width - 1)
    row = pixel // width
    column = pixel - row * width
    camera = gather_row(cameras, item, 13)
    right, up, back, origin = (mi.Vector3f(*camera[i:12:4]) for i in range(4))
    grid = Grid(*spec.middle, camera[12] * spec.pixel_aspect, camera[12])

    def look(x: Any, y: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Return what the rays through the point (x, y) of each pixel meet.

        That is t, object id, normal, radiance and own colour.

        Their directions have -z = 1 in the camera frame, so t is planar depth. Those of panoramas
        have length 1, so that it is the distance, and pass through the middles of pixels.
        """
        if meshes:
            local = ray_of(meshes, grid, column, row, x, y)
        else:
            local = (*grid.slopes(mi.Float(column) + x, mi.Float(row) + y), -1.0)
        d = right * local[0] + up * local[1] + back * local[2]
        own = mi.Vector3f(1)
        if cubes:
            t, object_id, n = closest_cube(cubes, item, origin, d)
        elif meshes:
            keys = rasterise(meshes, x, y)
            hit = nearest_triangle(meshes, keys, item * rays + pixel, local)
            t, object_id, flat, smooth = nearer_than_room(scenes, item, origin, d, hit)
            if colors is not None:
                color = color_of_nearest(meshes, keys, item * rays + pixel, local, colors)
                own = dr.select(object_id > 0, color, own)
        else:
            t, object_id, face, uv = closest_hit(scenes, item, origin, d)
        p = origin + dr.select(object_id >= 0, t, 0) * d
        if not (meshes or cubes):
            flat, smooth = normals_at(scenes, item, p, d, object_id, face, uv)
        if not cubes:
            n = visible_normal(scenes, item, p, d, object_id, (flat, smooth))
        tint = None if colors is None else own
        radiance = radiance_at(scenes, item, p, d, n, object_id, spec.shadows, tint)
        return t, object_id, n, radiance, own

    # Positions in a pixel are variables for the rasteriser, whose kernel serves all of them.
    middle = dr.opaque(mi.Float, 0.5) if meshes else 0.5
    t, object_id, n, image, own = look(middle, middle)
    if sampled:
        total = image if spec.spp % 2 else mi.Vector3f(0)
        image = _sum_of_samples(total, spec.spp // 2 * 2, look, bool(meshes)) / spec.spp
    if spec.image_dtype == "uint8":
        image = _converted(dr.uint8_array_t(mi.Vector3f), dr.round(dr.clip(image, 0, 1) * 255))
    elif spec.image_dtype == "float16":
        image = _converted(dr.float16_array_t(mi.Vector3f), image)
    normal = mi.Vector3f(dr.dot(n, right), dr.dot(n, up), dr.dot(n, back))
    albedo = dr.select(object_id >= 0, reflectance_at(scenes, item, object_id) * own, dr.nan)
    return {
        "albedo": list(albedo),
        "image": list(image),
        "depth": [dr.select(object_id >= 0, t, dr.nan)],
        "normal": list(normal),
        "object_id": [_converted(dr.int8_array_t(mi.Float), object_id)],
    }


def _sum_of_samples(total: Any, count: int, look: Callable[..., Any], one_by_one: bool) -> Any:
    """Add the colours at the first of `pixel_samples.sample_positions` other than the centre.

    Args:
        one_by_one: whether a kernel is launched for each sample, instead of one for all.
    """

    def add_sample(sample: Any, total: Any) -> tuple[Any, Any]:
        mirrored = (sample & 1) == 1
        x, y = (0.5 + mi.Float(sample // 2 + 1) * step for step in SAMPLE_STEPS)
        x, y = (dr.select(mirrored, 1 - (f - dr.floor(f)), f - dr.floor(f)) for f in (x, y))
        return sample + 1, total + look(x, y)[3]

    state = (mi.UInt32(0), total)
    if not one_by_one:
        return dr.while_loop(state, lambda i, _: i < count, add_sample, mode="symbolic")[1]
    for i in range(count):
        state = add_sample(dr.opaque(mi.UInt32, i), state[1])
        dr.eval(state)
    return state[1]

"""(c): nothing but the nearest hits of the primary rays, the limit for any renderer of the scenes.

There are two structures. `unit_scene` is scenegen's own: every object is cast at its unit shape, in
a structure that is never rebuilt. `lattice` puts all scenes of a batch side by side into one
Mitsuba scene, with objects as instances and rays bounded by the room; it is built for every batch.
Only the ray parameter and an id are evaluated.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from benchmarks.jobs.inputs import read_depth, read_scenes
from benchmarks.jobs.timing import repeat
from scenegen.camera import pixel_size
from scenegen.description.specs import DatasetSpec
from scenegen.objects.basic_shapes import unit_shape
from scenegen.rendering.backend import select_variant
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.pixels import upload_scenes
from scenegen.rendering.rays import Scenes, closest_hit
from scenegen.rendering.unit_scene import mitsuba_shape

Array = NDArray[Any]
BATCHES = (64, 256)
SPACING = 2.0  # lattice: the camera is 1.5 from a point inside the unit room, so its rays stay near
CHECKED = 16  # images whose depths are compared with the stored ones


def unit_scene(rooms: str, count: int, repeats: int) -> dict[str, Any]:
    """Time the cast at the unit scene, for the better batch size."""
    variant = select_variant("cpu")
    mi.set_variant(variant)
    spec, scenes = read_scenes(rooms, count)
    seconds = {}
    for size in BATCHES:
        batches = [pack(spec, scenes[i : i + size]) for i in range(0, count, size)]
        casts = [
            partial(
                cast_at_unit_scene,
                upload_scenes(batch, variant)[0],
                camera_table(batch),
                len(batch),
                spec,
            )
            for batch in batches
        ]
        seconds[size] = repeat(partial(evaluate, casts), repeats)
    wrong = share_of_wrong_depths(casts[0]()[0], rooms, spec)
    size = min(seconds, key=lambda key: min(seconds[key]))
    note = f"no build; batches of {size}; depths off by > 1e-4: {wrong:.4%}"
    return {"seconds": seconds[size], "images": count, "note": note}


def lattice(rooms: str, count: int, repeats: int) -> dict[str, Any]:
    """Time the cast at the lattice for the better batch size and kind of traversal."""
    mi.set_variant(select_variant("cpu"))
    spec, scenes = read_scenes(rooms, count)
    groups = shape_groups(spec)
    seconds, build = {}, {}
    for size in BATCHES:
        batches = [pack(spec, scenes[i : i + size]) for i in range(0, count, size)]
        start = time.perf_counter()
        built = [build_lattice(batch, groups) for batch in batches]
        build[size] = time.perf_counter() - start
        for coherent in (False, True):
            casts = [
                partial(cast_at_lattice, scene, table, len(batch), spec, coherent)
                for batch, (scene, table) in zip(batches, built, strict=True)
            ]
            seconds[size, coherent] = repeat(partial(evaluate, casts), repeats)
    wrong = share_of_wrong_depths(casts[0]()[0], rooms, spec)
    size, coherent = min(seconds, key=lambda key: min(seconds[key]))
    apart = ", ".join(f"{build[size] / count * 1e3:.2f} in batches of {size}" for size in BATCHES)
    note = (
        f"batches of {size}, coherent={coherent}; build apart, ms/image: {apart};"
        f" depths off by > 1e-4: {wrong:.4%}"
    )
    return {"seconds": seconds[size, coherent], "images": count, "note": note}


def evaluate(casts: Sequence[Callable[[], tuple[Any, Any]]]) -> None:
    """Run casts one behind the other and wait for the last."""
    for cast in casts:
        dr.eval(*cast())
    dr.sync_thread()


def camera_table(batch: SceneBatch, offset: Array | float = 0.0) -> Any:
    """Return 16 floats an image: 3x4 world_from_camera, pixel size, where its scene is moved to."""
    camera = batch.world_from_camera[:, :3].reshape(-1, 12)
    fovs = batch.fov_y_degrees.tolist()
    pixel = np.array([[pixel_size(batch.spec.height, fov)] for fov in fovs])
    move = np.broadcast_to(offset, (len(batch), 3))
    table = np.concatenate([camera, pixel, move], axis=1)
    return mi.Float(table.astype(np.float32).ravel())


def rays(table: Any, images: int, spec: DatasetSpec) -> tuple[Any, Any, Any, Any]:
    """Return image number, origin and direction of each primary ray, and the scene's offset."""
    pixels = spec.height * spec.width
    index = dr.arange(mi.UInt32, images * pixels)
    item = index // pixels
    pixel = index - item * pixels
    row = pixel // spec.width
    column = pixel - row * spec.width
    camera: list[Any] = [dr.gather(mi.Float, table, item * 16 + i) for i in range(16)]
    right, up, back, origin = (mi.Vector3f(*camera[i:12:4]) for i in range(4))
    x = (mi.Float(column) + 0.5 - spec.width / 2) * camera[12]
    y = (spec.height / 2 - 0.5 - mi.Float(row)) * camera[12]
    return item, origin, right * x + up * y - back, mi.Vector3f(*camera[13:])


def cast_at_unit_scene(
    scenes: Scenes, table: Any, images: int, spec: DatasetSpec
) -> tuple[Any, Any]:
    """Return ray parameter and object id of the nearest hits."""
    item, origin, direction, _ = rays(table, images, spec)
    t, object_id, _, _ = closest_hit(scenes, item, origin, direction)
    return t, object_id


def shape_groups(spec: DatasetSpec) -> dict[str, Any]:
    """Return what instances refer to. The exact sphere is none of them: it is as fast by itself,
    and as an instance far from the origin Mitsuba finds it up to a third of a unit off.
    """
    meshes = {name: unit_shape(name) for name in spec.shapes if not unit_shape(name).is_sphere}
    return {
        name: mi.load_dict({"type": "shapegroup", "mesh": mitsuba_shape(shape, np.zeros(3))})
        for name, shape in meshes.items()
    }


def build_lattice(batch: SceneBatch, groups: dict[str, Any]) -> tuple[Any, Any]:
    """Return all scenes of a batch in one, on a compact centred lattice, and their camera table."""
    side = int(np.ceil(len(batch) ** (1 / 3)))
    cell = np.stack(np.unravel_index(np.arange(len(batch)), (side, side, side)), axis=1)
    offset = (cell - (side - 1) / 2) * SPACING
    matrices = batch.world_from_object.copy()
    matrices[..., :3, 3] += offset[:, None]
    contents: dict[str, Any] = {"type": "scene", **groups}
    for b, k in np.argwhere(batch.shape >= 0):
        group = groups.get(batch.spec.shapes[batch.shape[b, k]])
        matrix = mi.ScalarTransform4f(matrices[b, k])
        if group is None:
            contents[f"object_{b}_{k}"] = {"type": "sphere", "to_world": matrix}
        else:
            contents[f"object_{b}_{k}"] = {"type": "instance", "group": group, "to_world": matrix}
    return mi.load_dict(contents), camera_table(batch, offset)


def cast_at_lattice(
    scene: Any, table: Any, images: int, spec: DatasetSpec, coherent: bool
) -> tuple[Any, Any]:
    """Return ray parameter and instance of the nearest hits; the room is three planes."""
    _, origin, direction, offset = rays(table, images, spec)
    planes = [dr.select(direction[i] < 0, -origin[i] / direction[i], dr.inf) for i in range(3)]
    room = dr.minimum(planes[0], dr.minimum(planes[1], planes[2]))
    ray = mi.Ray3f(mi.Ray3f(mi.Point3f(origin + offset), direction), room)
    hit = scene.ray_intersect_preliminary(ray, coherent=coherent)
    return dr.minimum(hit.t, room), dr.reinterpret_array(mi.UInt32, hit.instance)


def share_of_wrong_depths(t: Any, rooms: str, spec: DatasetSpec) -> float:
    """Return the share of the first images' depths that differ from the stored ones."""
    stored = read_depth(rooms, CHECKED)
    cast = t.numpy().reshape(-1, spec.height, spec.width)[:CHECKED]
    return float((np.abs(cast - stored) > 1e-4).mean())

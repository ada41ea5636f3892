"""(c): nothing but the nearest hits of the primary rays, the limit for any renderer of the scenes.

There are two structures. `unit_scene` is scenegen's own: every object is cast at its unit shape, in
a structure that is never rebuilt. `lattice` puts all scenes of a batch side by side into one
Mitsuba scene, with objects as instances and rays bounded by the room; it is built for every batch.
Only the ray parameter and an id are evaluated.
"""

import time
from collections.abc import Callable, Iterator, Sequence
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
from scenegen.rendering.drjit_renderer import upload_scenes
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.rays import Scenes, closest_hit
from scenegen.rendering.unit_scene import mitsuba_shape

Array = NDArray[Any]
Casts = Sequence[Callable[[], tuple[Any, Any]]]
BATCHES = (64, 256)
SPACING = 2.0  # lattice: the camera is 1.5 from a point inside the unit room, so its rays stay near
CHECKED = 16  # images whose depths are compared with the stored ones


def unit_scene(rooms: str, count: int, repeats: int) -> dict[str, Any]:
    """Time the cast at the unit scene, for the better batch size."""
    variant = select_variant("cpu")
    mi.set_variant(variant)
    spec, scenes = read_scenes(rooms, count)

    def ways() -> Iterator[tuple[str, Casts]]:
        for size in BATCHES:
            batches = [pack(spec, scenes[i : i + size]) for i in range(0, count, size)]
            known = [(one, upload_scenes(one, variant)[0], camera_table(one)) for one in batches]
            yield f"batches of {size}", [partial(cast_at_unit_scene, *one) for one in known]

    seconds, note = fastest(ways(), repeats, rooms, spec)
    return {"seconds": seconds, "images": count, "note": f"no build; {note}"}


def lattice(rooms: str, count: int, repeats: int) -> dict[str, Any]:
    """Time the cast at the lattice for the better batch size and kind of traversal."""
    mi.set_variant(select_variant("cpu"))
    spec, scenes = read_scenes(rooms, count)
    groups, build = shape_groups(spec), []

    def ways() -> Iterator[tuple[str, Casts]]:
        for size in BATCHES:
            batches = [pack(spec, scenes[i : i + size]) for i in range(0, count, size)]
            start = time.perf_counter()
            built = [build_lattice(batch, groups) for batch in batches]
            spent = (time.perf_counter() - start) / count
            build.append(f"{1e3 * spent:.2f} in batches of {size}")
            for coherent in (False, True):
                pairs = zip(batches, built, strict=True)
                casts = [partial(cast_at_lattice, one, *known, coherent) for one, known in pairs]
                yield f"batches of {size}, coherent={coherent}", casts

    seconds, note = fastest(ways(), repeats, rooms, spec)
    note = f"{note}; build apart, ms/image: {', '.join(build)}"
    return {"seconds": seconds, "images": count, "note": note}


def fastest(
    ways: Iterator[tuple[str, Casts]], repeats: int, rooms: str, spec: DatasetSpec
) -> tuple[list[float], str]:
    """Return the seconds of the way with the fastest repeat, and a note that names it.

    The ways are made one after another, as Mitsuba slows down with the shapes that are alive.
    """
    seconds = {}
    for name, casts in ways:
        seconds[name] = repeat(partial(evaluate, casts), repeats)
    stored = read_depth(rooms, CHECKED)
    found = casts[0]()[0].numpy().reshape(-1, spec.height, spec.width)[:CHECKED]
    wrong = float((np.abs(found - stored) > 1e-4).mean())
    best = min(seconds, key=lambda name: min(seconds[name]))
    return seconds[best], f"{best}; depths off by > 1e-4: {wrong:.4%}"


def evaluate(casts: Casts) -> None:
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


def rays(batch: SceneBatch, table: Any) -> tuple[Any, Any, Any, Any]:
    """Return image number, origin and direction of each primary ray, and the scene's offset."""
    spec, pixels = batch.spec, batch.spec.height * batch.spec.width
    index = dr.arange(mi.UInt32, len(batch) * pixels)
    item = index // pixels
    pixel = index - item * pixels
    row = pixel // spec.width
    column = pixel - row * spec.width
    camera: list[Any] = [dr.gather(mi.Float, table, item * 16 + i) for i in range(16)]
    right, up, back, origin = (mi.Vector3f(*camera[i:12:4]) for i in range(4))
    x = (mi.Float(column) + 0.5 - spec.width / 2) * camera[12]
    y = (spec.height / 2 - 0.5 - mi.Float(row)) * camera[12]
    return item, origin, right * x + up * y - back, mi.Vector3f(*camera[13:])


def cast_at_unit_scene(batch: SceneBatch, scenes: Scenes, table: Any) -> tuple[Any, Any]:
    """Return ray parameter and object id of the nearest hits."""
    item, origin, direction, _ = rays(batch, table)
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
        kind = {"type": "sphere"} if group is None else {"type": "instance", "group": group}
        kind["to_world"] = mi.ScalarTransform4f(matrices[b, k])
        contents[f"object_{b}_{k}"] = kind
    return mi.load_dict(contents), camera_table(batch, offset)


def cast_at_lattice(batch: SceneBatch, scene: Any, table: Any, coherent: bool) -> tuple[Any, Any]:
    """Return ray parameter and instance of the nearest hits; the room is three planes."""
    _, origin, direction, offset = rays(batch, table)
    planes = [dr.select(direction[i] < 0, -origin[i] / direction[i], dr.inf) for i in range(3)]
    room = dr.minimum(planes[0], dr.minimum(planes[1], planes[2]))
    ray = mi.Ray3f(mi.Ray3f(mi.Point3f(origin + offset), direction), room)
    hit = scene.ray_intersect_preliminary(ray, coherent=coherent)
    return dr.minimum(hit.t, room), dr.reinterpret_array(mi.UInt32, hit.instance)

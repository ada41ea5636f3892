"""Rules that every row of a file of rooms must keep, by itself and with its scene's description.

The arrays agree with the description; depths, normals and object ids are possible and agree with
one another; and shading them gives the image.
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Lens, pixel_directions, transform_points, transform_vectors
from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.description.specs import Request
from scenegen.files.rows import RowBlock
from scenegen.layout import CORRUPTION
from scenegen.objects.catalogue import Objects, changed_meshes
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.shading import shade
from scenegen.rooms.pack import described
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.rooms.truth import truth_problems

Array = NDArray[Any]
UNIT_TOLERANCE = 1e-5  # by which the length of a normal may differ from 1
PLANE_TOLERANCE = 1e-5  # scene units that float32 depths may put a surfel off its plane
RADIANCE_TOLERANCE = 1e-5  # float32's rounding in the shading equation, for radiance up to 1
OUTSIDE = 0.25  # metres beyond the inner walls to which windows reach
LOBE_TOLERANCE = 4e-7  # relative rounding of a highlight for each unit of its exponent
PIXELS = ("image", "depth", "normal", "object_id")
_RULES = {
    "description": "the JSON of the scene is readable and agrees with the arrays",
    "depth": "finite and positive on surfaces, NaN elsewhere",
    "normal": "unit length and facing the viewer on surfaces, zero elsewhere",
    "object_id": "from -1 to the object count; every object has enough visible pixels",
    "image": "finite, not negative, and equal to the shading equation",
}


_FURTHER_RULES = {
    "amodal": "masks contain the visible pixels, stay in bounding spheres and give the visible"
    " fractions",
    "coordinates": "agree with depth and poses",
    "flow": "flow and occlusion agree with depth and cameras",
    "albedo": "reflectance of the object ids",
    "layers": "in order, begin with depth and object ids, and enter and leave objects in turn",
}


def row_rules(rooms: RoomsFile) -> dict[str, str]:
    """Return what is checked of each row, by name of the check."""
    further = {name: _FURTHER_RULES[name] for name in rooms.spec.truth}
    return {**_pixel_rules(rooms.spec, CORRUPTION in rooms.attributes), **further}


def _pixel_rules(spec: Request, corrupted: bool) -> dict[str, str]:
    if spec.shading == "path" or corrupted:
        return {**_RULES, "image": "finite and not negative"}
    if spec.spp > 1 or spec.shadows:
        return {**_RULES, "image": "finite, and not darker than ambient light"}
    return _RULES


def row_problems(
    rooms: RoomsFile, block: RowBlock, i: int, objects: Objects
) -> Iterable[tuple[str, str]]:
    """Yield name of the check and a sentence for each problem of row `i` of a block."""
    try:
        room = rooms.room(i, block.read)
        batch = pack(rooms.spec, [room.scene], (room.view_index,), objects)
    except (SceneGenError, IndexError) as error:
        readable = True
        for name in PIXELS:
            try:
                block.read(name, i)
            except FileFormatError:
                readable = False
                yield name, f"{name} cannot be read"
        if readable:
            yield "description", str(error)
        return
    with np.errstate(all="ignore"):  # a damaged number may overflow, and is found all the same
        points = transform_points(room.world_from_camera, room.points)
        shown = block.read("object/visible_pixels", i)
        found = {
            "description": _description_problems(rooms, block, room, batch, objects),
            "depth": _depth_problems(room, points),
            "normal": _normal_problems(room),
            "object_id": _object_problems(rooms.spec, room, shown),
            "image": _image_problems(
                rooms.spec, room, points, batch, CORRUPTION in rooms.attributes
            ),
        }
        yield from ((name, problem) for name, some in found.items() for problem in some)
        if rooms.spec.truth:
            yield from _further_problems(rooms, block, room)


def _further_problems(rooms: RoomsFile, block: RowBlock, room: Room) -> Iterable[tuple[str, str]]:
    names = ("material/reflectance", "object/world_from_object")
    other, views = room, len(rooms.spec.view_angles)
    if "flow" in rooms.spec.truth:
        first = room.index - room.index % views
        try:
            other = rooms.room(first + (room.index + 1) % views, block.read)
        except (SceneGenError, IndexError) as error:
            yield "flow", str(error)
            return
    stored = {**room.truth, **{name: block.read(name, room.index) for name in names}}
    yield from truth_problems(rooms.spec, stored, room, other, room.scene)


def _description_problems(
    rooms: RoomsFile, block: RowBlock, room: Room, batch: SceneBatch, objects: Objects
) -> Iterable[str]:
    changed = changed_meshes(objects, room.scene)
    if changed:
        yield f"made from other files than the folder's: {', '.join(changed)}"
    views = len(rooms.spec.view_angles)
    first = room.index - room.index % views
    if room.view_index != room.index - first or len(room.scene.cameras) != views:
        yield f"view_index or the number of cameras is not that of the {views} views"
        return
    if room.view_index and block.read("scene", room.index) != block.read("scene", first):
        yield "the scene's description differs from that of its first view"
    for name, (expected,) in described(batch, np.array([0])).items():
        found = block.read(name, room.index)
        if name == "object/model":
            same = [model.decode("utf-8", "replace") for model in found] == expected.tolist()
        else:
            same = np.array_equal(found, expected) or np.allclose(
                found, expected, rtol=0, atol=1e-12
            )
        if not same:
            yield f"{name} differs from the scene's description"


def _depth_problems(room: Room, points: Array) -> Iterable[str]:
    hit = room.object_id >= 0
    if not (np.isfinite(room.depth[hit]).all() and (room.depth[hit] > 0).all()):
        yield "a hit pixel's depth is not a positive number"
    if not np.isnan(room.depth[~hit]).all():
        yield "a pixel without a hit has a depth"
    walls = np.abs(points[room.object_id == 0])
    if room.scene.interior:
        size = np.array(room.scene.interior.size) / 2
        if walls.size and not (np.abs(points[room.object_id == 0] - size) < size + OUTSIDE).all():
            yield "a surfel of the room is outside its walls"
    elif walls.size and not (walls.min(axis=1) < PLANE_TOLERANCE).all():
        yield "a surfel of the room is not on ground or walls"


def _normal_problems(room: Room) -> Iterable[str]:
    hit = room.object_id >= 0
    normal = room.normal.astype(np.float64)
    length = np.sqrt(np.einsum("yxi,yxi->yx", normal, normal))
    if not (np.abs(length[hit] - 1) < UNIT_TOLERANCE).all():
        yield f"a normal's length is off 1 by {np.nanmax(np.abs(length[hit] - 1)):.1e}"
    if not (room.normal[~hit] == 0).all():
        yield "a pixel without a hit has a normal"
    rays = _rays(*room.depth.shape, room.lens)
    if not (np.einsum("yxi,yxi->yx", normal, rays)[hit] < UNIT_TOLERANCE).all():
        yield "a normal faces away from the viewer"


@lru_cache(maxsize=1)
def _rays(height: int, width: int, lens: Lens) -> Array:
    """Return the unit directions of pixels, in the camera frame, (H, W, 3)."""
    rays = pixel_directions(height, width, lens)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def _object_problems(spec: Request, room: Room, shown: Array) -> Iterable[str]:
    count = len(room.scene.objects)
    if room.object_id.min() < -1 or room.object_id.max() > count:
        yield f"object ids {room.object_id.min()} to {room.object_id.max()}, {count} objects"
        return
    visible = visible_pixels(room.object_id[None], spec.object_slots)[0]
    if not np.array_equal(visible, shown):
        yield "object/visible_pixels does not count them"
    if not spec.seen_enough(visible[None], np.array([count]))[0]:
        yield f"too few objects show {spec.min_visible_pixels} pixels"


def _image_problems(
    spec: Request, room: Room, points: Array, batch: SceneBatch, corrupted: bool
) -> Iterable[str]:
    radiance = room.radiance
    if not np.isfinite(radiance).all() or (radiance < 0).any():
        yield "a value is negative or not finite"
        return
    if spec.shading == "path" or corrupted:
        return
    if spec.spp > 1 or spec.shadows:
        # With shadows, or the mean of several samples, only a lower bound is known: ambient light.
        darkest = (batch.reflectance[0, : batch.object_count[0] + 1] * batch.ambient[0]).min(axis=0)
        darkest = 0 * darkest if spec.own_reflectance else darkest
        if (room.object_id >= 0).all() and (radiance < darkest - 0.5 / 255 - 1e-3).any():
            yield "a pixel is darker than ambient light"
        return
    material = room.object_id.clip(0, spec.object_slots)
    specular, shininess = batch.gloss[0, material, 0], batch.gloss[0, material, 1]
    rho = batch.reflectance[0, material]
    if spec.own_reflectance:
        rho = np.nan_to_num(room.truth["albedo"])
    matte = (
        np.nan_to_num(points),
        transform_vectors(room.world_from_camera, room.normal),
        rho,
        batch.light_position[0, : batch.light_count[0]],
        batch.light_color[0, : batch.light_count[0]],
        batch.ambient[0],
        batch.attenuation[0],
    )
    reference = shade(*matte)
    tolerance = RADIANCE_TOLERANCE * np.maximum(reference, 1.0)
    if spec.specular[1] > 0:
        shine = shade(*matte, specular, shininess, room.world_from_camera[:3, 3]) - reference
        tolerance += LOBE_TOLERANCE * shininess[..., None] * shine
        reference += shine
    reference[room.object_id < 0] = room.scene.background
    step = {"uint8": 0.5 / 255, "float16": 2.0**-11, "float32": 0.0}[spec.image_dtype]
    if spec.image_dtype == "uint8":
        reference = reference.clip(0, 1)
    off = np.abs(radiance - reference) - step * np.maximum(reference, 1.0) - tolerance
    if (off > 0).any():
        yield f"{int((off > 0).any(-1).sum())} pixels are not what the shading equation gives"

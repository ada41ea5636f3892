"""Check a file of rooms: its layout, the values of every row, and some rows rendered again.

For every row: the arrays agree with the scene's description; depths, normals and object ids are
possible and agree with one another; and shading them gives the image. For some rows: the seed
still gives the description, and the description the pixels.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_directions, transform_points, transform_vectors
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.description.specs import DatasetSpec, Fingerprint
from scenegen.objects.catalogue import Objects, changed_meshes, objects_of
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.renderer import render
from scenegen.rendering.shading import shade
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.rooms.writer import described
from scenegen.sampling.scenes import MAX_ATTEMPTS, sample_scene

Array = NDArray[Any]
UNIT_TOLERANCE = 1e-5  # by which the length of a normal may differ from 1
PLANE_TOLERANCE = 1e-5  # scene units that float32 depths may put a surfel off its plane
RADIANCE_TOLERANCE = 1e-5  # float32's rounding in the shading equation, for radiance up to 1
LOBE_TOLERANCE = 4e-7  # relative rounding of a highlight for each unit of its exponent
# Rows rendered again agree bit for bit where variant and versions are those that wrote the file.
# Elsewhere a pixel agrees where its object id is equal, its depth and each component of its normal
# differ by no more than this, and its image by no more than one step of uint8 or, for floats, this
# share of the radiance. Rounding may turn pixels on silhouettes and edges to another surface.
DEPTH_TOLERANCE = 1e-5  # scene units
NORMAL_TOLERANCE = 1e-3
IMAGE_TOLERANCE = {"uint8": 0.0, "float16": 2.0**-10, "float32": 1e-4}
PATH_TOLERANCE = 0.1  # share by which the mean of a path-traced image's channel may differ
EDGE_SHARE = 1e-3  # of a row's pixels that may disagree
SHOWN = 5  # problems that a message names; of more it gives the number


@dataclass(frozen=True)
class Check:
    """One rule, whether the file keeps it, and what was checked or found wrong (`detail`)."""

    name: str
    ok: bool
    detail: str


def verify_file(
    path: str | Path,
    items: int = 8,
    device: str = "auto",
    objects: Objects | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Check]:
    """Check every row's values, and render `items` rows, spread evenly over the file, again.

    Args:
        objects: what its scenes are made of; None where its objects are built in.
        progress: called with the number of rows read since the last call.

    Raises as `RoomsFile`; SpecError where the file shows meshes and `objects` are not given; and
    BackendError where the device cannot render here.
    """
    with RoomsFile(path) as rooms:
        objects = objects or objects_of(rooms.spec)
        broken: dict[str, list[str]] = {name: [] for name in _ROW_RULES}
        fingerprint = Fingerprint(rooms.spec)
        for i in range(len(rooms)):
            if rooms.read("view_index", i) == 0:
                fingerprint.add(rooms.read("scene", i))
            for name, problem in _row_problems(rooms, i, objects):
                broken[name].append(f"row {i}: {problem}")
            progress(1)
        wrong = rooms.problems()
        layout = f"{len(rooms)} rows, format {rooms.attributes['format_version']}"
        checks = [Check("layout", not wrong, "; ".join(wrong[:SHOWN]) or layout)]
        rules = dict(_ROW_RULES)
        if rooms.spec.shading == "path":
            rules["image"] = "finite and not negative"
        elif rooms.spec.spp > 1 or rooms.spec.shadows:
            rules["image"] = "finite, and no darker than ambient light alone"
        checks += [_row_check(name, rules[name], broken[name], len(rooms)) for name in rules]
        same = fingerprint.hex == rooms.fingerprint
        checks.append(Check("fingerprint", same, rooms.fingerprint if same else "does not match"))
        rows = np.unique(np.linspace(0, len(rooms) - 1, min(items, len(rooms))).round().astype(int))
        if len(rows):
            checks.append(_sampled_again(rooms, rows, objects))
            checks.append(_rendered_again(rooms, rows, device, objects))
    return checks


_PIXELS = ("image", "depth", "normal", "object_id")
_ROW_RULES = {
    "description": "the scene's JSON can be read and agrees with the arrays",
    "depth": "finite and positive where something is hit, NaN elsewhere",
    "normal": "unit and facing the viewer where something is hit, zero elsewhere",
    "object_id": "from -1 to the object count; every object shows enough pixels",
    "image": "finite, not negative, and the shading equation of the other values",
}


def _row_check(name: str, rule: str, problems: list[str], count: int) -> Check:
    if not problems:
        return Check(name, True, f"{rule} ({count} rows)")
    more = f" and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
    return Check(name, False, "; ".join(problems[:SHOWN]) + more)


def _row_problems(rooms: RoomsFile, i: int, objects: Objects) -> Iterable[tuple[str, str]]:
    try:
        room = rooms[i]
        batch = pack(rooms.spec, [room.scene], (room.view_index,), objects)
    except (SceneGenError, IndexError) as error:
        readable = True
        for name in _PIXELS:
            try:
                rooms.read(name, i)
            except FileFormatError:
                readable = False
                yield name, f"{name} cannot be read"
        if readable:
            yield "description", str(error)
        return
    found = {
        "description": _description_problems(rooms, room, batch, objects),
        "depth": _depth_problems(room),
        "normal": _normal_problems(room),
        "object_id": _object_problems(rooms, room),
        "image": _image_problems(rooms, room, batch),
    }
    with np.errstate(all="ignore"):  # a damaged number may overflow, and is found all the same
        yield from ((name, problem) for name, some in found.items() for problem in some)


def _description_problems(
    rooms: RoomsFile, room: Room, batch: SceneBatch, objects: Objects
) -> Iterable[str]:
    changed = changed_meshes(objects, room.scene)
    if changed:
        yield f"made from other files than the folder's: {', '.join(changed)}"
    views = len(rooms.spec.views)
    first = room.index - room.index % views
    if room.view_index != room.index - first or len(room.scene.cameras) != views:
        yield f"view_index or the number of cameras is not that of the {views} views"
        return
    if room.view_index and rooms.read("scene", room.index) != rooms.read("scene", first):
        yield "the scene's description differs from that of its first view"
    for name, expected in described(batch, 0, room.scene).items():
        found = rooms.read(name, room.index)
        if name == "object/model":
            same = [model.decode("utf-8", "replace") for model in found] == expected
        else:
            same = np.allclose(found, expected, rtol=0, atol=1e-12)
        if not same:
            yield f"{name} differs from the scene's description"


def _depth_problems(room: Room) -> Iterable[str]:
    hit = room.object_id >= 0
    if not (np.isfinite(room.depth[hit]).all() and (room.depth[hit] > 0).all()):
        yield "a hit pixel's depth is not a positive number"
    if not np.isnan(room.depth[~hit]).all():
        yield "a pixel without a hit has a depth"
    walls = np.abs(room.points_world[room.object_id == 0])
    if walls.size and not (walls.min(axis=1) < PLANE_TOLERANCE).all():
        yield "a surfel of the room lies off floor and walls"


def _normal_problems(room: Room) -> Iterable[str]:
    hit = room.object_id >= 0
    length = np.linalg.norm(room.normal.astype(np.float64), axis=-1)
    if not (np.abs(length[hit] - 1) < UNIT_TOLERANCE).all():
        yield f"a normal's length is off 1 by {np.nanmax(np.abs(length[hit] - 1)):.1e}"
    if not (room.normal[~hit] == 0).all():
        yield "a pixel without a hit has a normal"
    rays = pixel_directions(room.depth.shape[0], room.depth.shape[1], room.fov_y_degrees)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    if not ((room.normal * rays).sum(-1)[hit] < UNIT_TOLERANCE).all():
        yield "a normal faces away from the viewer"


def _object_problems(rooms: RoomsFile, room: Room) -> Iterable[str]:
    count = len(room.scene.objects)
    if room.object_id.min() < -1 or room.object_id.max() > count:
        yield f"object ids {room.object_id.min()} to {room.object_id.max()}, {count} objects"
    visible = visible_pixels(room.object_id[None], rooms.spec.object_slots)[0]
    if not np.array_equal(visible, rooms.read("object/visible_pixels", room.index)):
        yield "object/visible_pixels does not count them"
    if (visible[:count] < rooms.spec.min_visible_pixels).any():
        yield f"an object shows {visible[:count].min()} pixels"


def _image_problems(rooms: RoomsFile, room: Room, batch: SceneBatch) -> Iterable[str]:
    radiance = room.radiance
    if not np.isfinite(radiance).all() or (radiance < 0).any():
        yield "a value is negative or not finite"
        return
    if rooms.spec.shading == "path":
        return
    if rooms.spec.spp > 1 or rooms.spec.shadows:
        # With shadows, or the mean of several samples, only a lower bound is known: ambient light.
        darkest = (batch.reflectance[0, : batch.object_count[0] + 1] * batch.ambient[0]).min(axis=0)
        if (room.object_id >= 0).all() and (radiance < darkest - 0.5 / 255 - 1e-3).any():
            yield "a pixel is darker than ambient light alone"
        return
    material = np.maximum(room.object_id, 0)
    specular, shininess = batch.gloss[0, material, 0], batch.gloss[0, material, 1]
    matte = (
        transform_points(room.world_from_camera, np.nan_to_num(room.points)),
        transform_vectors(room.world_from_camera, room.normal),
        batch.reflectance[0, material],
        batch.light_position[0, : batch.light_count[0]],
        batch.light_color[0, : batch.light_count[0]],
        batch.ambient[0],
        batch.attenuation[0],
    )
    reference = shade(*matte)
    tolerance = RADIANCE_TOLERANCE * np.maximum(reference, 1.0)
    if rooms.spec.specular[1] > 0:
        shine = shade(*matte, specular, shininess, room.world_from_camera[:3, 3]) - reference
        tolerance += LOBE_TOLERANCE * shininess[..., None] * shine
        reference += shine
    reference[room.object_id < 0] = room.scene.background
    step = {"uint8": 0.5 / 255, "float16": 2.0**-11, "float32": 0.0}[rooms.spec.image_dtype]
    if rooms.spec.image_dtype == "uint8":
        reference = reference.clip(0, 1)
    off = np.abs(radiance - reference) - step * np.maximum(reference, 1.0) - tolerance
    if (off > 0).any():
        yield f"{int((off > 0).any(-1).sum())} pixels are not what the shading equation gives"


def _sampled_again(rooms: RoomsFile, rows: Array, objects: Objects) -> Check:
    """Check that the seed still gives the stored descriptions."""
    wrong = []
    for i in rows.tolist():
        try:
            stored = rooms.scene(i)
            draw = partial(sample_scene, rooms.spec, stored.index, objects=objects)
            same = any(draw(k) == stored for k in range(MAX_ATTEMPTS))
        except (FileFormatError, SpecError):
            same = False
        if not same:
            wrong.append(f"row {i}")
    detail = ", ".join(wrong) + " cannot be drawn again" if wrong else f"{len(rows)} rows"
    return Check("drawn again from the seed", not wrong, detail)


def _rendered_again(rooms: RoomsFile, rows: Array, device: str, objects: Objects) -> Check:
    """Check that the stored descriptions still give the stored pixels."""
    here = {"variant": select_variant(device), **versions()}
    stored = {name: str(rooms.attributes.get(name, "not stored")) for name in here}
    others = [f"{x} {stored[x]}, here {here[x]}" for x in here if stored[x] != here[x]]
    wrong, off = [], 0
    for i in rows.tolist():
        try:
            room = rooms[i]
            with np.errstate(all="ignore"):
                again = render(pack(rooms.spec, [room.scene], (room.view_index,), objects), device)
        except (FileFormatError, SpecError, BadMeshError):
            wrong.append(f"row {i} (cannot be read)")
            continue
        pairs = {name: (getattr(room, name), getattr(again, name)[0]) for name in _PIXELS}
        differs = [
            name for name, pair in pairs.items() if not np.array_equal(*pair, equal_nan=True)
        ]
        off += bool(differs)
        if others:
            with np.errstate(all="ignore"):
                differs = [n for n in differs if not _within_tolerance(n, *pairs[n], rooms.spec)]
        if differs:
            wrong.append(f"row {i} ({', '.join(differs)})")
    what = f"{off} of {len(rows)} rows within the tolerance alone" if off else "bit for bit"
    detail = "differ: " + ", ".join(wrong) if wrong else f"{len(rows)} rows, {what}"
    remark = f" (the file's {'; '.join(others)})" if others else ""
    return Check("rendered again", not wrong, detail + remark)


def _within_tolerance(name: str, stored: Array, again: Array, spec: DatasetSpec) -> bool:
    """Return whether two arrays of pixels, (H, W, ...), agree as far as other versions can."""
    most: float | Array
    a, b = stored.astype(np.float64), again.astype(np.float64)
    if name != "image":
        most = {"depth": DEPTH_TOLERANCE, "normal": NORMAL_TOLERANCE, "object_id": 0.0}[name]
    elif spec.shading == "path":
        # Another release may draw other paths: only the mean of each channel is comparable.
        means = a.mean(axis=(0, 1)), b.mean(axis=(0, 1))
        return bool((np.abs(means[0] - means[1]) <= PATH_TOLERANCE * means[1]).all())
    elif spec.image_dtype == "uint8":
        most = 1.0
    else:
        relative = IMAGE_TOLERANCE[spec.image_dtype] + LOBE_TOLERANCE * spec.shininess[1]
        most = relative * np.abs(b) + RADIANCE_TOLERANCE
    close = (np.abs(a - b) <= most) | (np.isnan(a) & np.isnan(b))
    pixels = close.reshape(*close.shape[:2], -1).all(axis=-1)
    return bool((~pixels).mean() <= EDGE_SHARE)

"""Check a file of rooms: its layout, digests and rows, and some rows rendered again.

Every row keeps the rules of `row_rules`. For some rows: the seed still gives the description, and
the description the pixels.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import Request
from scenegen.files.content import fingerprint
from scenegen.files.rows import RowBlock, content_problems
from scenegen.files.verify import (
    Check,
    content_check,
    listed_check,
    made_elsewhere,
    read_all,
    spread_rows,
)
from scenegen.layout import CORRUPTION, FORMAT_VERSION
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.rendering.amodal import amodal_masks
from scenegen.rendering.backend import EXACT_VARIANT, exact_kind, select_variant
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import PICTURE, render
from scenegen.rooms.reader import Room, RoomsFile
from scenegen.rooms.row_rules import (
    LOBE_TOLERANCE,
    RADIANCE_TOLERANCE,
    row_problems,
    row_rules,
)
from scenegen.rooms.truth import stored_layers
from scenegen.rooms.withheld import truth_path
from scenegen.sampling.scenes import most_attempts, sample_scenes

Array = NDArray[Any]
# Rows rendered again agree bit for bit where a file is of the exact kind that is rendered here.
# Else a pixel agrees where its object id is equal, its depth and each component of its normal
# differ by no more than this, and its image by no more than one step of uint8 or, for floats, this
# share of the radiance. Rounding may turn pixels at edges to the surface of a neighbour.
DEPTH_TOLERANCE = 1e-4  # scene units
EDGE_NORMAL = 0.05  # difference of a normal's component from a neighbour's at an edge
NORMAL_TOLERANCE = 1e-3
IMAGE_TOLERANCE = {"uint8": 0.0, "float16": 2.0**-10, "float32": 1e-4}
PATH_TOLERANCE = 0.1  # share by which the mean of a path-traced image's channel may differ
PATCH = 16  # pixels of a side; pictures of closed rooms agree if the means of all patches do,
PATCH_TOLERANCE = 0.03  # by this share of white. Rounding turns few paths, so noise is alike
EXPOSURE_TOLERANCE = 0.02
ALBEDO_SHARE = 0.01  # of values of albedo that may differ, at edges
EDGE_SHARE = 1e-3  # of a row's pixels that may disagree
AMODAL = "object/amodal_mask"
BLOCK_PIXELS = 2**20  # of the rows that are read at once
BATCH_PIXELS = 2**22  # of the rows that are rendered at once
TRIED_AT_ONCE = 100  # proposals of a scene that is drawn again


def verify_file(
    rooms: RoomsFile,
    items: int = 8,
    device: str = "auto",
    objects: Objects | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Check]:
    """Check every row's values, and render `items` rows, spread evenly over the file, again.

    Args:
        objects: what its scenes are made of; None where its objects are built in.
        progress: called with the number of rows read since the last call.

    Raises SpecError where the file shows meshes and `objects` are not given, FileFormatError where
    its attributes cannot be read, and BackendError where the device cannot render here.
    """
    made_of = objects or objects_of(rooms.spec)

    def look(block: RowBlock, row: int) -> Iterable[tuple[str, str]]:
        return row_problems(rooms, block, row, made_of)

    step = max(1, BLOCK_PIXELS // (rooms.spec.height * rooms.spec.width))
    digests, broken = read_all(rooms, step, look, progress)
    rules = row_rules(rooms)
    scenes = {"scene": digests.get("scene", "")}
    same = fingerprint(rooms.spec.to_json(), scenes) == rooms.fingerprint
    layout = f"{len(rooms)} images, format {rooms.attributes['format_version']}"
    return [
        listed_check("layout", layout, rooms.problems()),
        content_check("content", rooms.opened, digests),
        *(listed_check(x, f"{rules[x]} ({len(rooms)} images)", broken[x]) for x in rules),
        Check("fingerprint", same, rooms.fingerprint if same else "does not match"),
        *_some_again(rooms, items, device, made_of),
    ]


def verify_withheld(
    rooms: RoomsFile, progress: Callable[[int], Any] = lambda done: None
) -> list[Check]:
    """Check what a file that is handed out without truth holds: `withheld.withhold_truth`.

    `progress` as in `verify_file`.
    """
    step = max(1, BLOCK_PIXELS // (rooms.spec.height * rooms.spec.width))
    digests, _ = read_all(rooms, step, lambda block, row: (), progress)
    wrong = content_problems(rooms.opened, digests, whole=False)
    layout = f"{len(rooms)} images, format {rooms.attributes['format_version']}"
    truth = f"in {truth_path(rooms.path).name}, so nothing else is checked"
    return [
        listed_check("layout", layout, rooms.problems(whole=False)),
        listed_check("content", "all values match their SHA-256", wrong),
        Check("truth", True, truth),
    ]


def _some_again(rooms: RoomsFile, items: int, device: str, objects: Objects) -> list[Check]:
    """Draw and render some rows again, spread evenly over the file."""
    rows = spread_rows(len(rooms), items)
    if not rows:
        return []
    return [_sampled_again(rooms, rows, objects), _rendered_again(rooms, rows, device, objects)]


def _sampled_again(rooms: RoomsFile, rows: Sequence[int], objects: Objects) -> Check:
    """Check that the seed still gives the stored descriptions."""
    wrong = []
    for row in rows:
        try:
            stored = rooms.scene(row)
            same = any(scene == stored for scene in _proposals(rooms, stored.index, objects))
        except (FileFormatError, SpecError):
            same = False
        if not same:
            wrong.append(f"row {row}")
    detail = (
        ", ".join(wrong) + " differ"
        if wrong
        else f"the seed gives the stored scenes ({len(rows)} images)"
    )
    return Check("drawn again from the seed", not wrong, detail)


def _proposals(rooms: RoomsFile, index: int, objects: Objects) -> Iterator[SceneSpec]:
    """Yield what the seed proposes for an item, some at a time, as few are mostly enough."""
    step = 1 if rooms.spec.interior else TRIED_AT_ONCE  # closed rooms take long, one by one
    most = most_attempts(rooms.spec)
    for first in range(0, most, step):
        attempts = range(first, min(first + step, most))
        _, drawn = sample_scenes(rooms.spec, [index] * len(attempts), attempts, objects)
        yield from (drawn.scene(k) for k in range(len(drawn)))


def _rendered_again(rooms: RoomsFile, rows: Sequence[int], device: str, objects: Objects) -> Check:
    """Check that the stored descriptions still give the stored pixels."""
    variant = select_variant(device)
    here = {"format_version": FORMAT_VERSION, **exact_kind(variant)}
    others = made_elsewhere(rooms.attributes, here)
    if not others and variant != EXACT_VARIANT:
        others = [f"variant {variant}, whose rounding depends on the processor"]
    wrong, off = [], 0
    again = _render(rooms, rows, device, objects)
    for row in rows:
        if row not in again:
            wrong.append(f"row {row} (cannot be rendered)")
            continue
        room, pixels = again[row]
        if CORRUPTION in rooms.attributes:  # by `bench corrupt`: the images are others
            pixels.pop("image", None)
        pairs = {name: (_stored(room, name), values) for name, values in pixels.items()}
        differs = [
            name for name, pair in pairs.items() if not np.array_equal(*pair, equal_nan=True)
        ]
        off += bool(differs)
        rounded = differs if others else PICTURE if rooms.spec.shading == "path" else []
        with np.errstate(all="ignore"):
            edges = _edges(pixels["object_id"], pixels["normal"])
            differs = [
                x
                for x in differs
                if x not in rounded or not _within_tolerance(x, *pairs[x], edges, rooms.spec)
            ]
        if differs:
            wrong.append(f"row {row} ({', '.join(differs)})")
    within = f"within tolerances (depth {DEPTH_TOLERANCE:g}; ids equal except at edges)"
    what = f"{off} of {len(rows)} images {within}" if off else "equal bit for bit"
    detail = "differ: " + ", ".join(wrong) if wrong else f"{len(rows)} images, {what}"
    remark = f" (the file's {'; '.join(others)})" if others else ""
    return Check("rendered again", not wrong, detail + remark)


def _render(
    rooms: RoomsFile, rows: Sequence[int], device: str, objects: Objects
) -> dict[int, tuple[Room, dict[str, Array]]]:
    """Return the rooms of some rows and their pixels rendered again, where that is possible.

    Rows that show the same view of their scenes are rendered together, as most time goes into
    preparing a batch.
    """
    views = defaultdict[int, list[Room]](list)
    for row in rows:
        with suppress(FileFormatError):
            room = rooms[row]
            views[room.view_index].append(room)
    most = max(1, BATCH_PIXELS // (rooms.spec.height * rooms.spec.width))
    rendered: dict[int, tuple[Room, dict[str, Array]]] = {}

    def draw(view: int, shown: list[Room]) -> None:
        try:
            with np.errstate(all="ignore"):
                batch = pack(rooms.spec, [room.scene for room in shown], (view,), objects)
                pixels = render(batch, device).pixels()
                if "amodal" in rooms.spec.truth:
                    pixels[AMODAL] = amodal_masks(batch, device)
                layers = [
                    stored_layers(batch, i, pixels["depth"][i], pixels["object_id"][i])
                    for i in range(len(batch) if "layers" in rooms.spec.truth else 0)
                ]
                names = layers[0] if layers else ()
                pixels |= {name: np.stack([one[name] for one in layers]) for name in names}
        except (SpecError, BadMeshError):
            for room in shown if len(shown) > 1 else ():
                draw(view, [room])
            return
        for k, room in enumerate(shown):
            rendered[room.index] = room, {name: values[k] for name, values in pixels.items()}

    for view, same in views.items():
        for start in range(0, len(same), most):
            draw(view, same[start : start + most])
    return rendered


def _stored(room: Room, name: str) -> Array:
    return room.truth[name] if name in room.truth else np.asarray(getattr(room, name))


def _around(values: Array) -> Array:
    """Return each pixel, (H, W, ...), with its eight neighbours: (H, W, ..., 3, 3)."""
    wide = np.pad(values, [(1, 1), (1, 1), *[(0, 0)] * (values.ndim - 2)], mode="edge")
    return sliding_window_view(wide, (3, 3), axis=(0, 1))


def _edges(object_id: Array, normal: Array) -> Array:
    """Return the pixels, (H, W), at which rounding may decide which surface a ray hits."""
    ids, normals = (np.ptp(_around(x), axis=(-2, -1)) for x in (object_id.astype(int), normal))
    return np.asarray((ids > 0) | (normals > EDGE_NORMAL).any(axis=-1))


def _same_picture(name: str, a: Array, b: Array) -> bool:
    """Return whether two developed pictures, or what belongs to them, agree up to noise."""
    if name == "exposure":
        return bool(np.allclose(a, b, rtol=EXPOSURE_TOLERANCE))
    if name == "albedo":
        off = np.abs(a - b) > NORMAL_TOLERANCE
        return bool(off.mean() <= ALBEDO_SHARE)
    scale = 255.0 if a.max(initial=0.0) > 1.0 else max(float(b.mean()), 1e-9)
    rows, columns = (-(-n // PATCH) * PATCH for n in a.shape[:2])
    wide = [(0, rows - a.shape[0]), (0, columns - a.shape[1]), (0, 0)]
    off = np.pad(a - b, wide).reshape(rows // PATCH, PATCH, columns // PATCH, PATCH, 3)
    return bool(np.abs(off.mean(axis=(1, 3))).max() <= PATCH_TOLERANCE * scale)


def _within_tolerance(name: str, stored: Array, again: Array, edges: Array, spec: Request) -> bool:
    """Return whether two arrays of pixels, (H, W, ...), agree as far as other variants can."""
    most: float | Array
    if name == AMODAL:  # below, pixels come first
        stored, again = np.moveaxis(stored, 0, -1), np.moveaxis(again, 0, -1)
    elif stored.ndim < 2:
        return False
    a, b = stored.astype(np.float64), again.astype(np.float64)
    if spec.interior and name in PICTURE:
        return _same_picture(name, a, b)
    if name != "image":
        tolerances = {"depth": DEPTH_TOLERANCE, "normal": NORMAL_TOLERANCE}
        tolerances["layers/depth"] = DEPTH_TOLERANCE
        most = {**tolerances, "albedo": NORMAL_TOLERANCE}.get(name, 0.0)
    elif spec.shading == "path":
        # Rounding turns some paths, and another release draws others: only means are comparable.
        means = a.mean(axis=(0, 1)), b.mean(axis=(0, 1))
        return bool((np.abs(means[0] - means[1]) <= PATH_TOLERANCE * means[1]).all())
    elif spec.image_dtype == "uint8":
        most = 1.0
    else:
        relative = IMAGE_TOLERANCE[spec.image_dtype] + LOBE_TOLERANCE * spec.shininess[1]
        most = relative * np.abs(b) + RADIANCE_TOLERANCE
    close = (np.abs(a - b) <= most) | (np.isnan(a) & np.isnan(b))
    # At an edge a pixel may show what a neighbour shows; in an image, at that of a shadow, too.
    near = _around(b)
    low, high = (np.asarray(f.reduce(near, axis=(-2, -1))) for f in (np.fmin, np.fmax))
    beside = np.asarray((low - most <= a) & (a <= high + most))
    beside |= np.isnan(a) & np.isnan(near).any(axis=(-2, -1))
    if name != "image":
        beside &= edges.reshape(*edges.shape, *[1] * (a.ndim - 2))
    off = ~close.reshape(*close.shape[:2], -1).all(axis=-1)
    found = beside.reshape(*beside.shape[:2], -1).all(axis=-1)
    return bool(np.asarray(found)[off].all() and off.mean() <= EDGE_SHARE)

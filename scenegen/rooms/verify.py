"""Check a file of rooms: its layout, digests and rows, and some rows rendered again.

Every row keeps the rules of `row_rules`. For some rows: the seed still gives the description, and
the description the pixels.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec, Fingerprint
from scenegen.files.content import ColumnDigest
from scenegen.files.manifest import manifest_path, read_manifest, wrong_files
from scenegen.layout import FIELDS, FORMAT_VERSION, has_digests, has_old_draws
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render
from scenegen.rooms.reader import Room, RoomsFile, RowBlock
from scenegen.rooms.row_rules import (
    LOBE_TOLERANCE,
    PIXELS,
    RADIANCE_TOLERANCE,
    row_problems,
    row_rules,
)
from scenegen.sampling.scenes import MAX_ATTEMPTS, sample_scenes

Array = NDArray[Any]
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
BLOCK_PIXELS = 2**20  # of the rows that are read at once
BATCH_PIXELS = 2**22  # of the rows that are rendered at once
TRIED_AT_ONCE = 100  # proposals of a scene that is drawn again


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
        rules = row_rules(rooms.spec)
        broken: dict[str, list[str]] = {name: [] for name in rules}
        fingerprint = Fingerprint(rooms.spec)
        digests = {field.name: ColumnDigest() for field in FIELDS}
        step = max(1, BLOCK_PIXELS // (rooms.spec.height * rooms.spec.width))
        for start in range(0, len(rooms), step):
            block = RowBlock(rooms, range(start, min(start + step, len(rooms))))
            digests = {name: x for name, x in digests.items() if name in block.values}
            for name, digest in digests.items():
                digest.update(block.values[name])
            for i in block.rows:
                if block.read("view_index", i) == 0:
                    fingerprint.add(block.read("scene", i))
                for name, problem in row_problems(rooms, block, i, objects):
                    broken[name].append(f"row {i}: {problem}")
                progress(1)
        layout = f"{len(rooms)} rows, format {rooms.attributes['format_version']}"
        checks = [listed_check("layout", layout, rooms.problems())]
        checks.append(_content(rooms, {name: x.hex for name, x in digests.items()}))
        for name, rule in rules.items():
            checks.append(listed_check(name, f"{rule} ({len(rooms)} rows)", broken[name]))
        same = fingerprint.hex == rooms.fingerprint
        checks.append(Check("fingerprint", same, rooms.fingerprint if same else "does not match"))
        return checks + _some_again(rooms, items, device, objects)


def verify_set(
    path: str | Path,
    items: int = 8,
    device: str = "auto",
    objects: Objects | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Check]:
    """Check the shards of a set against its manifest, and render `items` rows again.

    Every byte is checked by the SHA-256 of its file, so values are not looked at one by one.

    Args and errors as `verify_file`; FileFormatError also where the manifest cannot be read.
    """
    path = Path(path)
    manifest = read_manifest(manifest_path(path))

    wrong = wrong_files(path.parent, manifest, progress)
    told = "every shard and the set are complete"
    checks = [
        listed_check("manifest", told, [] if manifest.complete else ["the set is not complete"])
    ]
    checks.append(listed_check("checksums", f"SHA-256 of {len(manifest.shards)} shards", wrong))
    if wrong:
        return checks
    with RoomsFile(path) as rooms:
        checks.append(listed_check("layout", f"{len(rooms)} rows", rooms.problems()))
        views = len(rooms.spec.views)
        scene, view = (rooms.read(n, slice(None)) for n in ("scene_index", "view_index"))
        count = manifest.count * views
        known = [(one.file, one.rows, one.content_digest) for one in manifest.shards]
        listed = [(one.file, one.rows, one.content_digest) for one in rooms.shards] or known
        missing = [] if len(scene) == count else [f"{len(scene)} rows, not {count}"]
        missing += [] if listed == known else ["other shards than in the manifest"]
        if not missing:
            every = np.arange(count)
            out = np.flatnonzero((scene != every // views) | (view != every % views))
            missing = [f"row {row}" for row in out[:SHOWN].tolist()]
        checks.append(listed_check("rows", f"each of {count} once, in order", missing))
        checks += _some_again(rooms, items, device, objects or objects_of(rooms.spec))
    return checks


def _some_again(rooms: RoomsFile, items: int, device: str, objects: Objects) -> list[Check]:
    """Draw and render some rows again, spread evenly over the file."""
    rows = np.unique(np.linspace(0, len(rooms) - 1, min(items, len(rooms))).round().astype(int))
    if not len(rows):
        return []
    return [_sampled_again(rooms, rows, objects), _rendered_again(rooms, rows, device, objects)]


def listed_check(name: str, detail: str, problems: Sequence[str]) -> Check:
    """Return the outcome of a check: what was checked, or the first problems."""
    if not problems:
        return Check(name, True, detail)
    more = f" and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
    return Check(name, False, "; ".join(problems[:SHOWN]) + more)


def _content(rooms: RoomsFile, digests: dict[str, str]) -> Check:
    """Check that the file's values and attributes are those that were written, bit for bit."""
    if not has_digests(rooms.attributes):
        version = rooms.attributes["format_version"]
        return Check("content", True, f"not checked: format {version} has no digests")
    problems = rooms.content_problems(digests)
    return listed_check("content", "every value and attribute as written, by SHA-256", problems)


def _sampled_again(rooms: RoomsFile, rows: Array, objects: Objects) -> Check:
    """Check that the seed still gives the stored descriptions."""
    if has_old_draws(rooms.attributes):
        version = rooms.attributes["format_version"]
        detail = f"not checked: format {version} drew other scenes from a seed"
        return Check("drawn again from the seed", True, detail)
    wrong = []
    for i in rows.tolist():
        try:
            stored = rooms.scene(i)
            same = any(scene == stored for scene in _proposals(rooms, stored.index, objects))
        except (FileFormatError, SpecError):
            same = False
        if not same:
            wrong.append(f"row {i}")
    detail = ", ".join(wrong) + " cannot be drawn again" if wrong else f"{len(rows)} rows"
    return Check("drawn again from the seed", not wrong, detail)


def _proposals(rooms: RoomsFile, index: int, objects: Objects) -> Iterator[SceneSpec]:
    """Yield what the seed proposes for an item, some at a time, as few are mostly enough."""
    for first in range(0, MAX_ATTEMPTS, TRIED_AT_ONCE):
        attempts = range(first, min(first + TRIED_AT_ONCE, MAX_ATTEMPTS))
        _, drawn = sample_scenes(rooms.spec, [index] * len(attempts), attempts, objects)
        yield from (drawn.scene(k) for k in range(len(drawn)))


def _rendered_again(rooms: RoomsFile, rows: Array, device: str, objects: Objects) -> Check:
    """Check that the stored descriptions still give the stored pixels."""
    if has_old_draws(rooms.attributes) and rooms.spec.source == "shapes":
        version = rooms.attributes["format_version"]
        detail = f"not checked: format {version} showed meshes of basic shapes"
        return Check("rendered again", True, detail)
    here = {"variant": select_variant(device), "format_version": FORMAT_VERSION, **versions()}
    stored = {name: str(rooms.attributes.get(name, "not stored")) for name in here}
    others = [f"{x} {stored[x]}, here {here[x]}" for x in here if stored[x] != here[x]]
    wrong, off = [], 0
    again = _render(rooms, rows.tolist(), device, objects)
    for i in rows.tolist():
        if i not in again:
            wrong.append(f"row {i} (cannot be rendered)")
            continue
        room, pixels = again[i]
        pairs = {name: (getattr(room, name), pixels[name]) for name in PIXELS}
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


def _render(
    rooms: RoomsFile, rows: list[int], device: str, objects: Objects
) -> dict[int, tuple[Room, dict[str, Array]]]:
    """Return the rooms of some rows and their pixels rendered again, where that is possible.

    Rows that show the same view of their scenes are rendered together, as most time goes into
    preparing a batch.
    """
    views = defaultdict[int, list[Room]](list)
    for i in rows:
        with suppress(FileFormatError):
            room = rooms[i]
            views[room.view_index].append(room)
    most = max(1, BATCH_PIXELS // (rooms.spec.height * rooms.spec.width))
    found: dict[int, tuple[Room, dict[str, Array]]] = {}

    def draw(view: int, some: list[Room]) -> None:
        try:
            with np.errstate(all="ignore"):
                batch = pack(rooms.spec, [room.scene for room in some], (view,), objects)
                pixels = vars(render(batch, device))
        except (SpecError, BadMeshError):
            for room in some if len(some) > 1 else ():
                draw(view, [room])
            return
        for k, room in enumerate(some):
            found[room.index] = room, {name: pixels[name][k] for name in PIXELS}

    for view, same in views.items():
        for start in range(0, len(same), most):
            draw(view, same[start : start + most])
    return found


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

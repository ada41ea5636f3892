"""Render scenes and pack their rows: proposing, rendering, checking and packing overlap.

Each worker process takes its own block of scenes through all of these steps. Memory does not grow
with the number of scenes.
"""

from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.heap import return_free_memory
from scenegen.description.scene_arrays import SceneArrays
from scenegen.description.specs import Request
from scenegen.files.sets.plan import Block
from scenegen.files.sets.sets import Packed
from scenegen.files.sets.workers import in_threads
from scenegen.files.table import packing_threads
from scenegen.layout import columns
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.families.store import MEMBER_STORE
from scenegen.rendering.amodal import amodal_masks
from scenegen.rendering.ground_truth import visible_pixels
from scenegen.rendering.packing import SceneBatch, pack_arrays
from scenegen.rendering.pictures.places import ASSETS
from scenegen.rendering.renderer import (
    WORTHWHILE,
    launch_fields,
    picture_fields,
    share_processors,
    trace,
    traced_at_once,
    truth_fields,
)
from scenegen.rooms.pack import RenderedScene, pack_rooms
from scenegen.rooms.truth import further_truth
from scenegen.sampling.proposals import ProposalQueue

Array = NDArray[Any]
BLOCK = 512  # images that a worker process makes in one go
INTERIORS = 16  # of their images, in place of BLOCK and of a batch: they take long, and much memory
PACKED = 16  # scenes that a thread packs in one go
WINDOW = 8  # batches that may be begun while the oldest item is still being proposed again

_Fetch = Callable[[], dict[str, Array]]
_Begun = tuple[SceneArrays, SceneBatch, _Fetch]  # a batch being rendered


@dataclass(frozen=True, eq=False)
class RoomsWork:
    """What is done to scenes, here or in other processes; a `making.Work`.

    Attributes:
        spec, objects: what they show.
        batch: images rendered at once.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
        cache_dir: where members of families are kept.
        assets: places of materials and surroundings, as `pictures.places.Places.use` takes them.
    """

    spec: Request
    batch: int
    device: str
    objects: Objects
    compression: str
    cache_dir: Path | None
    assets: tuple[Path | None, Path | None] = (None, None)

    @property
    def block(self) -> int:
        """Scenes that a worker process makes in one go."""
        images = INTERIORS if self.spec.interior else BLOCK
        return max(1, images // len(self.spec.view_angles))

    @property
    def worthwhile(self) -> int:
        """Images for which another worker process is worth while."""
        return INTERIORS if self.spec.interior else WORTHWHILE

    def packed_rows(self, block: Block, workers: int) -> Generator[Packed, None, dict[str, str]]:
        """Render scenes in order, and meanwhile pack their rows in threads.

        Returns why models were refused, by name.
        """
        MEMBER_STORE.use(self.cache_dir)
        ASSETS.use(*self.assets)
        share_processors(workers, self.device)
        fields = columns(self.spec)
        groups = (
            items[first : first + PACKED]
            for items in render_items(self.spec, block.items, self.batch, self.device, self.objects)
            for first in range(0, len(items), PACKED)
        )

        def packed(rooms: list[RenderedScene]) -> Packed:
            return [pack_rooms(rooms, fields, self.compression)]

        ahead = 2 * self.batch // PACKED
        yield from in_threads(packed, groups, packing_threads(workers), ahead)
        return self.objects.problems


def render_items(
    spec: Request,
    indices: Sequence[int],
    batch: int,
    device: str = "auto",
    objects: Objects | None = None,
    fields: Collection[str] | None = None,
    kept: Collection[str] = (),
) -> Iterator[list[RenderedScene]]:
    """Yield the accepted items in order, a list of them whenever some are complete.

    While a batch is rendered, the next one is proposed. An item whose objects do not all show
    enough pixels is proposed again. No new item is begun while the oldest one that is incomplete is
    more than WINDOW batches behind.

    Args:
        indices: of the items; they ascend.
        fields: what is asked for of `GroundTruth`; None for all. Truth that the spec asks for
            needs what it follows from.
        kept: what stays on the device, too, as in `renderer.launch_fields`.
    """
    objects = objects or objects_of(spec)
    views, traced = range(len(spec.view_angles)), spec.shading == "path"
    pictures = [name for name in picture_fields(spec) if fields is None or name in fields]
    needed = truth_fields(spec)
    if fields is not None and not spec.truth:
        needed = [name for name in needed if name in fields or name == "object_id"]
    names = needed + ([] if traced else pictures)
    most = INTERIORS if spec.interior else batch
    batch = max(1, min(batch, most) // len(views))  # scenes
    proposals = ProposalQueue(spec, indices, objects)
    finished: dict[int, RenderedScene] = {}
    next_out = 0

    def propose() -> tuple[SceneArrays, SceneBatch] | None:
        last = min(len(indices), next_out + WINDOW * batch)
        scenes = proposals.take(batch, indices[last - 1] + 1 if last else 0)
        return None if scenes is None else (scenes, pack_arrays(spec, scenes, views, objects))

    def begin(proposed: tuple[SceneArrays, SceneBatch] | None) -> _Begun | None:
        if proposed is None:
            return None
        return *proposed, launch_fields(proposed[1], names, device, kept)

    def complete() -> list[RenderedScene]:
        """Return the scenes that are next in order and there."""
        nonlocal next_out
        first = next_out
        while next_out < len(indices) and indices[next_out] in finished:
            next_out += 1
        return [finished.pop(item) for item in indices[first:next_out]]

    begun: _Begun | None = None
    while begun := begun or begin(propose()):
        scenes, packed, fetch = begun
        following = propose()
        truth = fetch()
        masks = amodal_masks(packed, device) if "amodal" in spec.truth else None
        begun = begin(following)
        for item, shown in zip(
            scenes.index.tolist(),
            _shown(scenes, packed, truth, masks, pictures, device),
            strict=True,
        ):
            if shown is None:
                proposals.refuse(item)
                continue
            proposals.accept(item)
            finished[item] = shown
            if traced and (ready := complete()):  # at once, as the next pictures take long
                yield ready
        if ready := complete():
            yield ready
        return_free_memory()


def _shown(
    scenes: SceneArrays,
    batch: SceneBatch,
    truth: dict[str, Array],
    masks: Array | None,
    pictures: Sequence[str],
    device: str,
) -> Iterator[RenderedScene | None]:
    """Yield each scene with its pixels, or None where some view shows too little of its objects.

    Path-traced pictures take long: they are made of scenes that are accepted.
    """
    spec = batch.spec
    visible = visible_pixels(truth["object_id"], spec.object_slots)
    seen = spec.seen_enough(visible, batch.object_count)
    enough = np.asarray(seen.reshape(len(scenes), -1).all(axis=1))
    traced = _traced(batch, np.flatnonzero(enough), pictures, device)
    for row, first in enumerate(range(0, len(batch), len(spec.view_angles))):
        images = slice(first, first + len(spec.view_angles))
        if not enough[row]:
            yield None
            continue
        pixels = {name: values[images] for name, values in truth.items()}
        if spec.shading == "path" and pictures:
            pixels |= next(traced)
        whole = None if masks is None else masks[images]
        if spec.truth:
            pixels |= further_truth(batch, first, pixels, whole)
        yield RenderedScene(scenes, row, batch, first, pixels, visible[images])


def _traced(
    batch: SceneBatch, scenes: Array, pictures: Sequence[str], device: str
) -> Iterator[dict[str, Array]]:
    """Yield the path-traced pictures of some scenes, of which several are traced at once."""
    views = len(batch.spec.view_angles)
    many = traced_at_once(batch.spec) // views
    for start in range(0, len(scenes), many):
        images = scenes[start : start + many, None] * views + np.arange(views)
        pixels = trace(batch.rows(images.ravel()), pictures, device)
        for first in range(0, images.size, views):
            yield {name: values[first : first + views] for name, values in pixels.items()}

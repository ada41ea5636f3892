"""Rooms without a file: endless batches of the rows that `scenegen render` would write."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.common.records import check
from scenegen.description.presets import preset_spec
from scenegen.description.specs import BUILT_IN, TRUTHS, Request, RoomSpec
from scenegen.files.schema import Column
from scenegen.files.stream import (
    Columns,
    RowStream,
    chosen_columns,
    common_columns,
    requests_and_shares,
)
from scenegen.layout import FURTHER, columns
from scenegen.objects.cache import default_cache_dir
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.families.store import MEMBER_STORE
from scenegen.rendering.backend import select_variant
from scenegen.rendering.ground_truth import KEPT
from scenegen.rendering.pictures.places import ASSETS
from scenegen.rendering.renderer import share_processors, stacked
from scenegen.rooms.make import DEFAULT_BATCH, check_batch
from scenegen.rooms.pack import room_rows
from scenegen.rooms.render import render_items

PIXELS = 2**20  # that are rendered at once, unless a batch has more
ON_DEVICE = ("image", "depth", "normal", "object_id")  # fields that may stay there
UNUSED = {"object/shape": -1, "object/stands_on": -1, "material/shininess": 1}  # slots; others 0


class RoomStream(RowStream):
    """Batches of rooms, rendered during training.

    Row i is, bit for bit, row i of the file that `scenegen render` makes of the same request.
    Iterating gives dicts of numpy arrays (B, ...) with the names, types and units of the file's
    columns (`layout.FIELDS`); image values are as stored.

        stream = scenegen.RoomStream("shapes", fields=("image", "depth"), batch=64, workers=2)
    """

    def __init__(
        self,
        preset_or_spec: "str | Request | Mapping[str | Request, float]",
        *,
        fields: Sequence[str] = ("image", "depth", "normal", "object_id"),
        batch: int = DEFAULT_BATCH,
        start: int = 0,
        stop: int | None = None,
        device: str = "auto",
        workers: int = 0,
        rank: int | None = None,
        world_size: int | None = None,
        objects: Objects | None = None,
        on_device: bool = False,
        drop_last: bool = False,
    ) -> None:
        """Take a preset, a request, or several with the share of scenes that each gets.

        Of several, scene i is scene i of one of them, and the field "spec" says of which.

        Args:
            fields: columns of the file that are numbers, those of `--with` among them.
            batch: rows of a dict.
            start, stop: the first row, and the one before which the stream ends; None for never.
            device: as in `backend.DEVICES`.
            workers: processes of its own that render, into shared memory; 0 for this one.
            rank, world_size: which share of the batches comes, of how many; torch.distributed's by
                default.
            objects: models of requests for folders of meshes.
            drop_last: with `stop`, ranks get equally many batches of equally many rows each: by
                default some rows of the end are shown twice; with this, some are left out.
            on_device: leave pixels on the device, as Dr.Jit tensors, which `torch.from_dlpack`
                takes without a copy. Other fields, and all of path tracing, are numpy arrays.

        Raises SpecError for a setting out of range, an unknown field, or requests whose fields
        differ in shape; BackendError where the device cannot render here. Iterating raises
        PlacementError where no scene meets the request, and LostWorkerError where a process ended.
        """
        variant = select_variant(device)
        shares = requests_and_shares(preset_or_spec, RoomSpec)
        given = [
            preset_spec(request) if isinstance(request, str) else request for request in shares
        ]
        specs, asked = zip(*(_asked(spec, fields) for spec in given), strict=True)
        common, views = common_columns(asked), len(specs[0].views)
        places = (MEMBER_STORE.folder or default_cache_dir(), ASSETS.materials, ASSETS.environment)
        kept: list[str] = []
        if (
            on_device
            and variant != "scalar_rgb"
            and not any(spec.truth or spec.shading == "path" for spec in specs)
        ):
            kept = [name for name in ON_DEVICE if name in fields]
        makers = []
        for spec, share in zip(specs, shares.values(), strict=True):
            check_batch(batch, spec, views)
            check(
                len(spec.view_angles) == views,
                "views",
                len(spec.view_angles),
                f"{views}, as in the first",
            )
            own = objects_of(spec) if spec.source in BUILT_IN or objects is None else objects
            maker = partial(_rows, spec, own, common, kept, device, batch, places)
            makers.append((maker, share))
        super().__init__(
            common, makers, batch, start, stop, workers, rank, world_size, views,
            dict.fromkeys(kept, stacked), drop_last, [spec.to_json() for spec in specs],
        )  # fmt: skip


def _asked(spec: Request, fields: Sequence[str]) -> tuple[Request, Columns]:
    """Return a request for the truth that some fields need and no more, and their columns."""
    truth = tuple(name for name in TRUTHS if name != "flow" or len(spec.view_angles) > 1)
    asked = chosen_columns(fields, columns(replace(spec, truth=truth)))
    needed = tuple(n for n in truth if any(column.name in asked for column in FURTHER[n]))
    return replace(spec, truth=needed), asked


def _rows(
    spec: Request,
    objects: Objects,
    fields: Columns,
    kept: Sequence[str],
    device: str,
    batch: int,
    places: tuple[Path | None, Path | None, Path | None],
    numbers: list[int],
    processes: int,
) -> Iterator[dict[str, Any]]:
    """Yield rows of a request, as a `stream.Maker`. Raises as `render_items`."""
    MEMBER_STORE.use(places[0])
    ASSETS.use(*places[1:])
    share_processors(processes, device)
    views = len(spec.view_angles)
    # Path tracing takes long, one image after the other: nobody waits for more than a batch.
    more = 0 if spec.shading == "path" else PIXELS // (spec.height * spec.width)
    at_once = min(DEFAULT_BATCH, max(batch, more))
    items = list(dict.fromkeys(number // views for number in numbers))
    wanted = iter((*numbers, -1))
    number = next(wanted)
    for ready in render_items(spec, items, at_once, device, objects, fields, kept):
        values = room_rows(ready)
        chosen = {name: values[KEPT + name if name in kept else name] for name in fields}
        every = chain.from_iterable(range(r.index * views, (r.index + 1) * views) for r in ready)
        for place, row in enumerate(every):
            if row == number:
                yield {
                    name: of[place] if name in kept else _in_slots(of[place], fields[name])
                    for name, of in chosen.items()
                }
                number = next(wanted)


def _in_slots(value: Any, column: Column) -> Any:
    """Return the value of a column, with unused slots where other requests have more."""
    if np.shape(value) == column.shape:
        return value
    wide = np.full(column.shape, UNUSED.get(column.name, 0), value.dtype)
    wide[: len(value)] = value
    return wide

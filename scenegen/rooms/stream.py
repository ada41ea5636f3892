"""Rooms without a file: endless batches of the rows that `scenegen render` would write."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.common.records import check
from scenegen.description.presets import preset_spec
from scenegen.description.specs import BUILT_IN, TRUTHS, DatasetSpec
from scenegen.files.schema import Column
from scenegen.files.stream import RowStream, check_fields, mixed
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


class RoomStream(RowStream):
    """Batches of the rows of a file of rooms, rendered while somebody learns from them.

    Row i is, bit for bit, row i of the file that `scenegen render` makes of the same request.
    Iterating gives dicts of numpy arrays (B, ...) with the names, types and units of the file's
    columns (`layout.FIELDS`); image values are as stored.

        stream = scenegen.RoomStream("shapes", fields=("image", "depth"), batch=64, workers=2)
    """

    def __init__(
        self,
        preset_or_spec: "str | DatasetSpec | Mapping[str | DatasetSpec, float]",
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
    ) -> None:
        """Take a preset, a request, or several with the share of scenes that each gets.

        Of several, room i shows scene i of one of them, and the field "spec" says of which.

        Args:
            fields: columns of the file that are numbers, those of `--with` among them.
            batch: rows of a dict.
            start, stop: the first row, and the one before which the stream ends; None for never.
            device: as in `backend.DEVICES`.
            workers: processes of its own that render, into shared memory; 0 for this one.
            rank, world_size: which share of the batches comes, of how many; torch.distributed's by
                default.
            objects: models of requests for folders of meshes.
            on_device: leave pixels on the device, as Dr.Jit tensors, which `torch.from_dlpack`
                takes without a copy; other fields, and those of path tracing, are numpy arrays.

        Raises SpecError for a setting out of range, an unknown field, or requests whose fields
        differ in shape; BackendError where the device cannot render here. Iterating raises
        PlacementError where no scene meets the request, and LostWorkerError where a process ended.
        """
        variant = select_variant(device)
        requests, shares = mixed(preset_or_spec, DatasetSpec)
        specs = [preset_spec(one) if isinstance(one, str) else one for one in requests]
        every = [_asked(spec, fields) for spec in specs]
        sources = []
        for spec, asked in zip(*_with_slots(every), strict=True):
            check_batch(batch, len(spec.views), spec)
            plain = on_device and variant != "scalar_rgb" and spec.shading != "path"
            kept = tuple(name for name in asked if name in PICTURED and plain and not spec.truth)
            own = objects_of(spec) if spec.source in BUILT_IN or objects is None else objects
            folder = MEMBER_STORE.folder or default_cache_dir()
            assets = (ASSETS.materials, ASSETS.environment)
            sources.append(RoomSource(spec, own, asked, kept, device, batch, folder, assets))
        alike = all(source.kept == sources[0].kept for source in sources)
        check(alike, "on_device", "requests of which some stay there", "all or none")
        on = dict.fromkeys(sources[0].kept, stacked)
        super().__init__(sources, shares, batch, start, stop, workers, rank, world_size, on)


PICTURED = ("image", "depth", "normal", "object_id")
UNUSED = {"object/shape": -1, "object/stands_on": -1, "material/shininess": 1}  # slots; others 0


def _with_slots(
    requests: Sequence[tuple[DatasetSpec, dict[str, Column]]],
) -> tuple[list[DatasetSpec], list[dict[str, Column]]]:
    """Return requests and their columns, all with as many slots as the request with the most."""
    every = [columns for _, columns in requests]

    def widened(column: Column) -> Column:
        others = [columns[column.name].shape for columns in every]
        slots = column.axes is not None and column.axes[:1] and column.axes[0].endswith("_slot")
        most = max(shape[0] for shape in others) if slots else 0
        return replace(column, shape=(most, *column.shape[1:])) if slots else column

    wide = [{name: widened(c) for name, c in columns.items()} for columns in every]
    return [spec for spec, _ in requests], wide


def _asked(spec: DatasetSpec, fields: Sequence[str]) -> tuple[DatasetSpec, dict[str, Column]]:
    """Return a request for the truth that some fields need and no more, and their columns."""
    truth = tuple(name for name in TRUTHS if name != "flow" or len(spec.views) > 1)
    asked = check_fields(fields, columns(replace(spec, truth=truth)))
    needed = tuple(n for n in truth if any(column.name in asked for column in FURTHER[n]))
    return replace(spec, truth=needed), asked


@dataclass(frozen=True, eq=False)
class RoomSource:
    """The rows of one request, as a `stream.Source`.

    Attributes:
        kept: columns that stay on the device.
        batch: rows of a dict.
        cache_dir, assets: as in `render.RoomsWork`.
    """

    spec: DatasetSpec
    objects: Objects
    columns: Mapping[str, Column]
    kept: tuple[str, ...]
    device: str
    batch: int
    cache_dir: Path | None
    assets: tuple[Path | None, Path | None]

    @property
    def together(self) -> int:
        """Rows of a scene."""
        return len(self.spec.views)

    def rows(self, numbers: Sequence[int], processes: int) -> Iterator[dict[str, Any]]:
        """Yield rows by their numbers. Raises as `render_items`."""
        MEMBER_STORE.use(self.cache_dir)
        ASSETS.use(*self.assets)
        share_processors(processes, self.device)
        spec, views = self.spec, self.together
        at_once = max(self.batch, min(DEFAULT_BATCH, PIXELS // (spec.height * spec.width)))
        items = list(dict.fromkeys(number // views for number in numbers))
        rendered = render_items(
            spec, items, min(at_once, DEFAULT_BATCH), self.device, self.objects, self.columns,
            self.kept,
        )  # fmt: skip
        wanted = iter((*numbers, -1))
        number = next(wanted)
        for ready in rendered:
            values = room_rows(ready)
            chosen = {name: values[KEPT + name if name in self.kept else name] for name in self.columns}
            every = chain.from_iterable(range(r.index * views, (r.index + 1) * views) for r in ready)
            for place, row in enumerate(every):
                if row == number:
                    yield {name: self._value(name, of[place]) for name, of in chosen.items()}
                    number = next(wanted)

    def _value(self, name: str, value: Any) -> Any:
        """Return the value of a column, with unused slots where other requests have more."""
        shape = self.columns[name].shape
        if name in self.kept or np.shape(value) == shape:
            return value
        wide = np.full(shape, UNUSED.get(name, 0), value.dtype)
        wide[: len(value)] = value
        return wide

"""Rows that are made while somebody learns from them, batch after batch: nothing is stored.

Batch k of a stream goes to one of equal shares: rank by rank, then to the workers of a
`torch.utils.data.DataLoader`, then to processes of its own. So the batches of a rank come in the
same order whoever makes them. Processes of its own write to memory that they share with this one;
it has no name, and is gone when the last process and the last array are.
"""

import math
import mmap
import os
import pickle
import sys
import tempfile
import weakref
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import chain, count, cycle, islice
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.common.records import check
from scenegen.files.pool import Process
from scenegen.files.schema import Column

if TYPE_CHECKING:
    from torch.utils.data import IterableDataset

    Base = IterableDataset[dict[str, Any]]
else:
    Base = object

Array = NDArray[Any]
Batch = dict[str, Any]
Stack = Callable[[list[Any], tuple[int, ...]], Any]
SOURCE = Column("spec", (), "int32", meaning="which of the stream's requests, from 0")
CHUNK = 4096  # rows that a source is asked for at once, so that it can draw many together
AHEAD = 2  # batches of each process that are made before they are asked for
MOST_PROCESSES = 256
ALIGNED = 64  # bytes
GOLDEN = 0x9E3779B97F4A7C15  # 2**64 over the golden ratio
_forked_renderer = False  # whether this process was forked from one that had loaded Dr.Jit


class Source(Protocol):
    """What makes rows; it can be pickled."""

    @property
    def columns(self) -> Mapping[str, Column]:
        """The columns that it is asked for."""

    @property
    def together(self) -> int:
        """How many rows are made together: row 0 and the next ones, and so on."""

    def rows(self, numbers: Sequence[int], processes: int) -> Iterator[Mapping[str, Any]]:
        """Yield the values of some rows by column, whose numbers ascend, one after another.

        `processes` share the processors.
        """


class RowStream(Base):
    """Endless batches of rows, dicts of arrays (B, ...). See `RoomStream` and `QuestionStream`.

    Every loop begins at row `start`, or where `load_state_dict` says. Where torch is imported, this
    is an `IterableDataset`; torch is not imported here.

    Attributes:
        columns: what the arrays are: `schema.Column`s with unit, frame and meaning, by field.
        batch: rows in each batch; where the stream ends, the last one may have fewer.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        shares: Sequence[float],
        batch: int,
        start: int,
        stop: int | None,
        workers: int,
        rank: int | None,
        world_size: int | None,
        on_device: Mapping[str, Stack] = MappingProxyType({}),
    ) -> None:
        """Take sources of the same columns, and the share of the rows that each of them makes.

        Args:
            on_device: fields that are no arrays, each with the function that makes what is handed
                out from a list of values, one a row, and the shape of all.

        Raises SpecError.
        """
        check(start >= 0, "start", start, "0 or more")
        check(0 <= workers <= MOST_PROCESSES, "workers", workers, f"from 0 to {MOST_PROCESSES}")
        where = "fields stay on the device" if on_device else "no POSIX system shares memory"
        check(not workers or (not on_device and os.name == "posix"), "workers", workers, f"0, as {where}")
        check((rank is None) == (world_size is None), "rank", rank, "it and world_size, or neither")
        if rank is not None and world_size is not None:
            check(0 <= rank < world_size, "rank", rank, f"from 0 to {world_size - 1}")
        positive = all(share > 0 and np.isfinite(share) for share in shares)
        check(bool(shares) and positive, "shares", list(shares), "a number above 0 for each")
        self.columns = {**sources[0].columns, **({"spec": SOURCE} if len(sources) > 1 else {})}
        for source in sources:
            for name, column in source.columns.items():
                own, other = ((c.shape, c.dtype) for c in (column, self.columns[name]))
                check(own == other, name, f"{own} beside {other}", "one shape and type to mix them")
            together = (source.together, sources[0].together)
            check(together[0] == together[1], "views", together, "as many in all requests")
        self.batch = batch
        self._sources, self._on_device = tuple(sources), dict(on_device)
        self._ends = np.cumsum(shares) / np.sum(shares) * 2.0**64
        self._start, self._stop, self._processes = start, stop, workers
        self._place = None if rank is None else (rank, world_size or 1)
        self._row, self._resumed = start, False

    def __iter__(self) -> Iterator[Batch]:
        """Yield batches. Raises as the sources, and LostWorkerError where a process ended."""
        if not self._resumed:
            self._row = self._start
        self._resumed = False
        return self._batches(self._row)

    def state_dict(self) -> dict[str, int]:
        """Return where the stream is: {"row": the first that no rank and worker has shown yet}.

        It holds where all of them have shown equally many batches; then any number of them can go
        on from it.
        """
        return {"row": self._row}

    def load_state_dict(self, state: Mapping[str, int]) -> None:
        """Let the next loop begin where `state_dict` was asked for."""
        self._row, self._resumed = int(state["row"]), True

    def _batches(self, first: int) -> Iterator[Batch]:
        rank, ranks = self._ranks()
        data = sys.modules.get("torch.utils.data")
        worker = data.get_worker_info() if data else None
        readers = worker.num_workers if worker else 1
        mine, shares = rank + ranks * (worker.id if worker else 0), ranks * readers
        if self._stop is not None and first >= self._stop:
            return
        # Threads of a renderer do not live on in a fork, so another process takes over.
        processes = self._processes or int(_forked_renderer)
        if processes:
            batches = self._from_processes(first, mine, shares, processes, readers)
        else:
            batches = self.made(first, mine, shares, readers, self._allocated)
        with closing(batches):
            for batch in batches:
                self._row += shares * self.batch
                yield batch

    def _ranks(self) -> tuple[int, int]:
        """Return this process's rank and their number; torch.distributed's by default."""
        if self._place is None and "torch.distributed" in sys.modules:
            distributed = sys.modules["torch.distributed"]
            if distributed.is_available() and distributed.is_initialized():
                return distributed.get_rank(), distributed.get_world_size()
        return self._place or (0, 1)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_place": self._ranks()}  # workers of a loader have no rank

    def _numbers(self, first: int, share: int, shares: int) -> Iterator[range]:
        """Yield the numbers of the rows of each batch of a share; one by one they are counted."""
        for start in count(first + share * self.batch, shares * self.batch):
            end = start + self.batch if self._stop is None else min(start + self.batch, self._stop)
            if start >= end:
                return
            yield range(start, end)

    def made(
        self,
        first: int,
        share: int,
        shares: int,
        processes: int,
        room: Callable[[int], dict[str, Any]],
    ) -> Generator[Batch]:
        """Yield the batches of a share from row `first` on, made in this process.

        Args:
            processes: that share the processors.
            room: returns what the next so many rows are written to, by field.
        """
        numbers = self._numbers(first, share, shares)
        while chunk := list(islice(numbers, max(1, CHUNK // self.batch))):
            rows = self._rows(list(chain.from_iterable(chunk)), processes)
            for each in chunk:
                batch = room(len(each))
                for place, row in enumerate(islice(rows, len(each))):
                    for name, values in batch.items():
                        values[place] = row[name]
                for name, stack in self._on_device.items():
                    batch[name] = stack(batch[name], (len(each), *self.columns[name].shape))
                yield batch

    def _rows(self, numbers: list[int], processes: int) -> Iterator[Mapping[str, Any]]:
        """Yield rows, each from the source whose turn it is.

        The turn follows from multiples of the golden ratio, which keeps the shares in every batch.
        """
        if len(self._sources) == 1:
            yield from self._sources[0].rows(numbers, processes)
            return
        items = np.array(numbers, np.uint64) // np.uint64(self._sources[0].together)
        turns = np.searchsorted(self._ends[:-1], items * np.uint64(GOLDEN), side="right").tolist()
        streams = [
            source.rows([n for n, turn in zip(numbers, turns, strict=True) if turn == i], processes)
            for i, source in enumerate(self._sources)
        ]
        for turn in turns:
            yield {**next(streams[turn]), "spec": turn}

    def _allocated(self, rows: int) -> dict[str, Any]:
        """Return arrays for so many rows, or lists where they stay on the device."""
        listed = {name: [None] * rows for name in self._on_device}
        return {
            name: listed.get(name) or np.empty((rows, *column.shape), column.dtype)
            for name, column in self.columns.items()
        }

    def _from_processes(
        self, first: int, mine: int, shares: int, processes: int, readers: int
    ) -> Generator[Batch]:
        """Yield batches from processes, which write the next ones meanwhile."""
        memory, owner = _Slots(self.columns, self.batch), os.getpid()
        waiting = [deque[int]() for _ in range(processes)]
        started: list[Process] = []

        def ask(which: int) -> None:
            waiting[which].append(memory.free_slot())
            started[which].ask(pickle.dumps(waiting[which][-1]))

        try:
            for which in range(processes):
                started.append(Process([memory.file]))
                part = (first, mine + shares * which, shares * processes, processes * readers)
                started[which].ask(pickle.dumps(_Filler(self, part, memory.file, memory.size)))
                for _ in range(AHEAD):
                    ask(which)
            for process in started:
                _result(process)
            for which in cycle(range(processes)):
                rows = _result(started[which])
                if not rows:
                    return
                slot = waiting[which].popleft()
                ask(which)
                yield memory.arrays(slot, rows)
        finally:
            if os.getpid() == owner:  # not in a fork
                for process in started:
                    process.kill()
                    process.end()
                os.close(memory.file)

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        """The type. Who asks, as `isinstance` does, may have imported torch since."""
        _tell_torch()
        return type(self)


def _tell_torch() -> None:
    """Let torch take streams for IterableDatasets, where it is imported."""
    data = sys.modules.get("torch.utils.data")
    if data is not None and hasattr(data, "IterableDataset"):
        data.IterableDataset.register(RowStream)


def check_fields(fields: Sequence[str], columns: Sequence[Column]) -> dict[str, Column]:
    """Return the columns of some fields, by name. Raises SpecError for one that there is not."""
    known = {column.name: column for column in columns if column.dtype != "text"}
    check(len(fields) > 0, "fields", "none", f"some of {', '.join(known)}")
    for name in fields:
        check_choice("field", name, known)
    return {name: known[name] for name in fields}


def mixed(requests: Any, kind: type) -> tuple[list[Any], list[float]]:
    """Return requests and their shares, from one request or a mapping to shares.

    Raises SpecError for what is neither a name nor of the kind.
    """
    several = dict(requests) if isinstance(requests, Mapping) else {requests: 1.0}
    for request in several:
        if not isinstance(request, (str, kind)):
            raise SpecError("stream", repr(request), f"the name of a preset, or a {kind.__name__}")
    return list(several), list(several.values())


class _Slots:
    """Memory that processes share, in slots of one batch each.

    A slot is free again when the last array that lies in it is gone.

    Attributes:
        file: its descriptor; size: of a slot, bytes.
    """

    def __init__(self, columns: Mapping[str, Column], batch: int) -> None:
        self._columns, self._free = columns, list[int]()
        self._maps: list[mmap.mmap] = []
        page, used = mmap.ALLOCATIONGRANULARITY, _places(columns, batch)[""]
        self.file, self.size = _unnamed_file(), -(-used // page) * page

    def free_slot(self) -> int:
        """Return the number of a free slot, perhaps a new one."""
        if self._free:
            return self._free.pop()
        slot = len(self._maps)
        os.ftruncate(self.file, (slot + 1) * self.size)
        self._maps.append(mmap.mmap(self.file, self.size, offset=slot * self.size))
        return slot

    def arrays(self, slot: int, rows: int) -> dict[str, Array]:
        """Return the first rows of a slot, by field."""
        whole = np.frombuffer(self._maps[slot], np.uint8)
        weakref.finalize(whole, self._free.append, slot)
        return _arrays_in(whole, self._columns, rows)


class _Filler:
    """What a process does: it writes the next batch of a share to a slot, and tells its rows."""

    def __init__(self, stream: RowStream, part: tuple[int, ...], file: int, size: int) -> None:
        """Take the arguments of `RowStream.made`, and the memory that processes share."""
        self._stream, self._part, self._file, self._size = stream, part, file, size
        self._maps: dict[int, mmap.mmap] = {}
        self._batches: Iterator[Batch] | None = None

    def __call__(self, slot: int) -> int:
        """Return how many rows were written; 0 at the end of the share."""
        if self._batches is None:
            self._batches = self._stream.made(*self._part, self._arrays)
        if slot not in self._maps:
            self._maps[slot] = mmap.mmap(self._file, self._size, offset=slot * self._size)
        self._slot = slot
        return len(next(iter(next(self._batches, {"": ()}).values())))

    def _arrays(self, rows: int) -> dict[str, Array]:
        whole = np.frombuffer(self._maps[self._slot], np.uint8)
        return _arrays_in(whole, self._stream.columns, rows)


def _unnamed_file() -> int:
    """Return a descriptor of memory, or of a file, that is gone when nobody has it open."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("rows")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def _places(columns: Mapping[str, Column], rows: int) -> dict[str, int]:
    """Return where the values of each column begin among those of so many rows; "" is the end."""
    places, end = {}, 0
    for name, column in columns.items():
        places[name] = end
        size = rows * math.prod(column.shape) * np.dtype(column.dtype).itemsize
        end += -(-size // ALIGNED) * ALIGNED
    return {**places, "": end}


def _arrays_in(memory: Array, columns: Mapping[str, Column], rows: int) -> dict[str, Array]:
    places = _places(columns, rows)
    return {
        name: np.ndarray((rows, *column.shape), column.dtype, memory, places[name])
        for name, column in columns.items()
    }


def _result(process: Process) -> Any:
    succeeded, result = process.heard()
    if not succeeded:
        raise result
    return result


def _after_fork() -> None:
    global _forked_renderer  # noqa: PLW0603
    _forked_renderer = "drjit" in sys.modules


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
_tell_torch()

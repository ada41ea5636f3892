"""Rows that are made while somebody learns from them, batch after batch: nothing is stored.

Batch k goes to one of equal shares: rank by rank, then to the workers of a torch `DataLoader`, then
to processes of the stream's own. So the batches of a rank come in one order, whoever makes them.
Own processes write to memory that they share with this one. It has no name, and is gone when the
last process and the last array are.
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
from contextlib import closing, suppress
from dataclasses import replace
from itertools import accumulate, chain, count, cycle, islice
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.common.records import check
from scenegen.files.pool import LostWorkerError, Process
from scenegen.files.schema import Column

if TYPE_CHECKING:
    from torch.utils.data import IterableDataset

    Base = IterableDataset[dict[str, Any]]
else:
    Base = object

Array = NDArray[Any]
Columns = Mapping[str, Column]
Batch = dict[str, Any]
# Yields the values of rows by column, one after another: of these numbers, which ascend, while so
# many processes share the processors. It can be pickled.
Maker = Callable[[list[int], int], Iterator[Mapping[str, Any]]]
Stack = Callable[[list[Any], tuple[int, ...]], Any]
SPEC = Column("spec", (), "int32", meaning="which of the stream's requests, from 0")
CHUNK = 4096  # rows that a maker is asked for at once, so that it can draw many together
AHEAD = 2  # batches of each process that are made before they are asked for
MOST_PROCESSES = 256
ALIGNED = 64  # bytes
GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # 2**64 over the golden ratio
_forked_renderer = False  # whether this process was forked from one that had loaded Dr.Jit


class RowStream(Base):
    """Endless batches of rows, dicts of arrays (B, ...). See `RoomStream` and `QuestionStream`.

    Every loop begins at row `start`, or where `load_state_dict` says. It raises what the makers
    raise, and LostWorkerError where a process ended, twice for the same batch if by a signal. Where
    torch is imported, this is an `IterableDataset`; torch is not imported here.

    Attributes:
        columns: what the arrays are: `schema.Column`s with unit, frame and meaning, by field.
        batch: rows in each batch; where the stream ends, the last one may have fewer.
    """

    def __init__(
        self,
        columns: Columns,
        makers: Sequence[tuple[Maker, float]],
        batch: int,
        start: int,
        stop: int | None,
        workers: int,
        rank: int | None,
        world_size: int | None,
        together: int = 1,
        on_device: Mapping[str, Stack] = MappingProxyType({}),
    ) -> None:
        """Take makers of rows, and the share of the rows that each of them makes.

        Args:
            together: how many rows have one maker: row 0 and the next ones, and so on.
            on_device: fields that are no arrays, each with the function that makes what is handed
                out of a list of values, one a row, and of the shape of all.

        Raises SpecError.
        """
        shares = [share for _, share in makers]
        positive = all(share > 0 and math.isfinite(share) for share in shares)
        check(bool(shares) and positive, "shares", shares, "a number above 0 for each")
        check(start >= 0, "start", start, "0 or more")
        check(0 <= workers <= MOST_PROCESSES, "workers", workers, f"from 0 to {MOST_PROCESSES}")
        alone = "fields stay on the device" if on_device else "this system shares no memory so"
        check(
            not workers or (os.name == "posix" and not on_device), "workers", workers, f"0: {alone}"
        )
        check((rank is None) == (world_size is None), "rank", rank, "it and world_size, or neither")
        ranks = 1 if world_size is None else world_size
        check(0 <= (rank or 0) < ranks, "rank", rank, f"from 0 to {ranks - 1}")
        self.columns, self.batch = {**columns, **({"spec": SPEC} if len(makers) > 1 else {})}, batch
        self._makers, self._together = [maker for maker, _ in makers], together
        self._ends = np.cumsum(shares)[:-1] / sum(shares) * 2.0**64
        self._start, self._stop, self._processes = start, stop, workers
        self._place = None if rank is None else (rank, ranks)
        self._on_device, self._row, self._resumed = dict(on_device), start, False

    def __iter__(self) -> Iterator[Batch]:
        """Begin a loop."""
        self._row, self._resumed = (self._row if self._resumed else self._start), False
        return self._batches(self._row)

    def state_dict(self) -> dict[str, int]:
        """Return where the stream is: {"row": the first that no rank and worker has shown yet}.

        It holds where all of them have shown equally many batches. Any number of them can then go
        on from it.
        """
        return {"row": self._row}

    def load_state_dict(self, state: Mapping[str, int]) -> None:
        """Let the next loop begin where `state_dict` was asked for."""
        self._row, self._resumed = int(state["row"]), True

    def _batches(self, first: int) -> Iterator[Batch]:
        if self._stop is not None and first >= self._stop:
            return
        rank, ranks = self._ranks()
        data = sys.modules.get("torch.utils.data")
        worker = data.get_worker_info() if data else None
        reader, readers = (worker.id, worker.num_workers) if worker else (0, 1)
        share, shares = rank + ranks * reader, ranks * readers
        # A renderer's threads do not live on in a fork, so a process of its own takes over there.
        if processes := self._processes or int(_forked_renderer):
            check(
                not self._on_device, "on_device", "a fork", "the process that loaded the renderer"
            )
            batches = self._from_processes(first, share, shares, processes, readers)
        else:
            batches = self.made(first, share, shares, readers, self._new)
        with closing(batches):
            for batch in batches:
                self._row += shares * self.batch
                yield batch

    def _ranks(self) -> tuple[int, int]:
        """Return this process's rank and their number; torch.distributed's by default."""
        distributed = sys.modules.get("torch.distributed")
        together = distributed and distributed.is_available() and distributed.is_initialized()
        if self._place is None and distributed and together:
            return distributed.get_rank(), distributed.get_world_size()
        return self._place or (0, 1)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_place": self._ranks()}  # a worker of a loader would not know it

    def made(
        self, first: int, share: int, shares: int, processes: int, new: Callable[[int], Batch]
    ) -> Generator[Batch]:
        """Yield the batches of a share from row `first` on, made in this process.

        Args:
            processes: that share the processors.
            new: returns what so many rows are written to.
        """
        size, end = self.batch, self._stop
        starts = count(first + share * size, shares * size)
        parts = (range(i, i + size if end is None else min(i + size, end)) for i in starts)
        while chunk := [part for part in islice(parts, max(1, CHUNK // size)) if part]:
            rows = self._rows(list(chain.from_iterable(chunk)), processes)
            for numbers in chunk:
                batch = new(len(numbers))
                for place, row in enumerate(islice(rows, len(numbers))):
                    for name, values in batch.items():
                        values[place] = row[name]
                for name, stack in self._on_device.items():
                    batch[name] = stack(batch[name], (len(numbers), *self.columns[name].shape))
                yield batch

    def _rows(self, numbers: list[int], processes: int) -> Iterator[Mapping[str, Any]]:
        """Yield rows, each from the maker whose turn it is.

        The turn follows from multiples of the golden ratio, which keeps the shares in every batch.
        """
        if len(self._makers) == 1:
            yield from self._makers[0](numbers, processes)
            return
        items = np.array(numbers, np.uint64) // np.uint64(self._together)
        turns = np.searchsorted(self._ends, items * GOLDEN, side="right")
        rows = [
            make(np.array(numbers)[turns == i].tolist(), processes)
            for i, make in enumerate(self._makers)
        ]
        for turn in turns.tolist():
            yield {**next(rows[turn]), "spec": turn}

    def _new(self, rows: int) -> Batch:
        """Return arrays for so many rows, and lists for fields that stay on the device."""
        return {
            name: [None] * rows
            if name in self._on_device
            else np.empty((rows, *column.shape), column.dtype)
            for name, column in self.columns.items()
        }

    def _from_processes(
        self, first: int, share: int, shares: int, processes: int, readers: int
    ) -> Generator[Batch]:
        """Yield batches from processes, which write the next ones meanwhile."""
        memory, owner = _Memory(self, _unnamed_file()), os.getpid()
        waiting = [deque[int]() for _ in range(processes)]
        started: list[Process] = []
        step, taken = shares * processes, [0] * processes  # batches that each process has made

        def begin(which: int) -> None:
            """Start a process that makes the batches that were not taken yet."""
            started[which:] = [Process([memory.file]), *started[which + 1 :]]
            row = first + taken[which] * step * self.batch
            part = (row, share + shares * which, step, processes * readers)
            started[which].ask(pickle.dumps(_Filler(self, part, memory.file)))
            for slot in waiting[which]:
                started[which].ask(pickle.dumps(slot))

        def answer(which: int) -> Any:
            succeeded, result = started[which].heard()
            if not succeeded:
                raise result
            return result

        def rows_of_next(which: int) -> int:
            """Wait for a batch; where a signal ended its process, another one makes it again."""
            try:
                return int(answer(which))
            except LostWorkerError as error:
                if not error.by_signal:
                    raise
            try:
                begin(which)
                answer(which)
                return int(answer(which))
            except LostWorkerError as error:
                row = first + (taken[which] * step + share + shares * which) * self.batch
                raise error.of(f"rows {row} to {row + self.batch - 1}") from None

        try:
            for which in range(processes):
                waiting[which].extend(memory.free_slot() for _ in range(AHEAD))
                begin(which)
            for which in range(processes):
                answer(which)  # that it is ready
            for which in cycle(range(processes)):
                rows, slot = rows_of_next(which), waiting[which].popleft()
                if not rows:
                    return
                taken[which] += 1
                waiting[which].append(memory.free_slot())
                with suppress(LostWorkerError):  # `rows_of_next` meets it
                    started[which].ask(pickle.dumps(waiting[which][-1]))
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
    data: Any = sys.modules.get("torch.utils.data")
    if hasattr(data, "IterableDataset"):
        data.IterableDataset.register(RowStream)


def requests_and_shares(requests: Any, kind: type) -> dict[Any, float]:
    """Return requests with their shares, from one request or a mapping.

    Raises SpecError for what is neither a name nor of the kind.
    """
    several = dict(requests) if isinstance(requests, Mapping) else {requests: 1.0}
    for request in several:
        if not isinstance(request, (str, kind)):
            raise SpecError("stream", repr(request), f"the name of a preset, or a {kind.__name__}")
    return several


def chosen_columns(fields: Sequence[str], columns: Sequence[Column]) -> dict[str, Column]:
    """Return the columns of some fields, by name. Raises SpecError for one that there is not."""
    known = {column.name: column for column in columns if column.dtype != "text"}
    check(len(fields) > 0, "fields", "none", f"some of {', '.join(known)}")
    for name in fields:
        check_choice("field", name, known)
    return {name: known[name] for name in fields}


def common_columns(requests: Sequence[Columns]) -> dict[str, Column]:
    """Return columns that hold the rows of all requests: with as many slots as any of them needs.

    Raises SpecError where they differ otherwise.
    """
    common = {}
    for name, column in requests[0].items():
        shapes, dtypes = zip(*((of[name].shape, of[name].dtype) for of in requests), strict=True)
        slots = any(axis.endswith("_slot") for axis in (column.axes or ())[:1])
        rest = {shape[1:] if slots else shape for shape in shapes} | {*dtypes}
        check(len(rest) == 2, name, f"rows of {shapes}", "one shape and type, to mix requests")
        common[name] = replace(column, shape=max(shapes)) if slots else column
    return common


class _Memory:
    """Memory that processes share, in slots of a batch each, as one process has it open.

    A slot is free again when the last array that lies in it is gone.
    """

    def __init__(self, stream: RowStream, file: int) -> None:
        self.file, self._columns, self._rows = file, stream.columns, stream.batch
        sizes = [
            self._rows * math.prod(column.shape) * np.dtype(column.dtype).itemsize
            for column in self._columns.values()
        ]
        *self._places, end = accumulate(
            (-(-size // ALIGNED) * ALIGNED for size in sizes), initial=0
        )
        self._size = -(-end // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
        self._free, self._maps = list[int](), dict[int, mmap.mmap]()

    def free_slot(self) -> int:
        """Return the number of a free slot, perhaps a new one."""
        if self._free:
            return self._free.pop()
        slot = len(self._maps)
        os.ftruncate(self.file, (slot + 1) * self._size)
        self._open(slot)
        return slot

    def arrays(self, slot: int, rows: int) -> dict[str, Array]:
        """Return the first rows of a slot, by field."""
        whole = np.frombuffer(self._open(slot), np.uint8)
        weakref.finalize(whole, self._free.append, slot)
        return {
            name: np.ndarray((self._rows, *column.shape), column.dtype, whole, place)[:rows]
            for (name, column), place in zip(self._columns.items(), self._places, strict=True)
        }

    def _open(self, slot: int) -> mmap.mmap:
        if slot not in self._maps:
            self._maps[slot] = mmap.mmap(self.file, self._size, offset=slot * self._size)
        return self._maps[slot]


class _Filler:
    """What a process does: it writes the next batch of a share to a slot."""

    def __init__(self, stream: RowStream, part: tuple[int, int, int, int], file: int) -> None:
        """Take the first arguments of `made`, and the descriptor of the memory."""
        self._stream, self._part, self._file = stream, part, file
        self._batches: Iterator[Batch] | None = None

    def __call__(self, slot: int) -> int:
        """Return how many rows were written; 0 at the end of the share."""
        self._slot = slot
        if self._batches is None:
            memory = _Memory(self._stream, self._file)
            self._batches = self._stream.made(
                *self._part, lambda rows: memory.arrays(self._slot, rows)
            )
        return len(next(iter(next(self._batches, {"": ()}).values())))


def _unnamed_file() -> int:
    """Return a descriptor of memory, or of a file, that is gone when nobody has it open."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("rows")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def _after_fork() -> None:
    global _forked_renderer  # noqa: PLW0603
    _forked_renderer = "drjit" in sys.modules


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
_tell_torch()

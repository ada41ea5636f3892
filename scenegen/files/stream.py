"""Rows that are made while somebody learns from them, batch after batch: nothing is stored.

Batch k goes to one of equal shares: rank by rank, then to the workers of a torch `DataLoader`, then
to processes of the stream's own. So the batches of a rank come in one order, whoever makes them.
Own processes write to memory that they share with this one. It has no name, and is gone when the
last process and the last array are.
"""

import hashlib
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
from functools import partial
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
    torch is imported, this is an `IterableDataset`; torch is not imported here. Own processes live
    as long as the stream.

    Attributes:
        columns: what the arrays are: `schema.Column`s with unit, frame and meaning, by field.
        batch: rows in each batch; where the stream ends, the last one of each rank may have fewer,
            equally many for all.
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
        drop_last: bool = False,
        requests: Sequence[str] = (),
    ) -> None:
        """Take makers of rows, and the share of the rows that each of them makes.

        Args:
            together: how many rows have one maker: row 0 and the next ones, and so on.
            on_device: fields that are no arrays, each with the function that makes what is handed
                out of a list of values, one a row, and of the shape of all.
            drop_last: whether rows at the end that do not suffice for all ranks are left out; by
                default some are shown twice.
            requests: what the rows are of, in words that tell it apart, for states.

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
        self._drop_last = drop_last
        self._workers: _Workers | None = None
        told = "\n".join([*requests, *map(str, shares)])
        self._request = hashlib.sha256(told.encode()).hexdigest()[:16]

    def __iter__(self) -> Iterator[Batch]:
        """Begin a loop."""
        self._row, self._resumed = (self._row if self._resumed else self._start), False
        return self._batches(self._row)

    def state_dict(self) -> dict[str, Any]:
        """Return where the stream is: "row" is the first that no rank and worker has shown yet.

        It holds where all of them have shown equally many batches. Any number of them can then go
        on from it. "request" tells what the rows are of.
        """
        return {"row": self._row, "request": self._request}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Let the next loop begin where `state_dict` was asked for.

        Raises SpecError for the state of a stream of another request, or what is no state.
        """
        row, request = state.get("row"), state.get("request", self._request)
        if not isinstance(row, int) or row < 0 or request != self._request:
            found = f"row {row!r:.20} of request {request!r:.20}"
            raise SpecError("state", found, "what state_dict gave, of a stream of this request")
        self._row, self._resumed = row, True

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
        # A worker of a loader would not know its rank, and has processes of its own.
        return {**vars(self), "_place": self._ranks(), "_workers": None}

    def made(
        self, first: int, share: int, shares: int, processes: int, new: Callable[[int], Batch]
    ) -> Generator[Batch]:
        """Yield the batches of a share from row `first` on, made in this process.

        Args:
            processes: that share the processors.
            new: returns what so many rows are written to.
        """
        parts = map(partial(self._part, first, self._ranks()[1]), count(share, shares))
        while chunk := [part for part in islice(parts, max(1, CHUNK // self.batch)) if part]:
            rows = self._rows(list(chain.from_iterable(chunk)), processes)
            for numbers in chunk:
                batch = new(len(numbers))
                for place, row in enumerate(islice(rows, len(numbers))):
                    for name, values in batch.items():
                        values[place] = row[name]
                for name, stack in self._on_device.items():
                    batch[name] = stack(batch[name], (len(numbers), *self.columns[name].shape))
                yield batch

    def _part(self, first: int, ranks: int, number: int) -> range:
        """Return the rows of a batch: at the end, equally many for all ranks."""
        size, end = self.batch, self._stop
        begin = first + number // ranks * ranks * size
        left = ranks * size if end is None else min(max(0, end - begin), ranks * size)
        rows = left // ranks if self._drop_last else -(-left // ranks)
        place = min(begin + number % ranks * rows, begin + left - rows)
        return range(place, place + rows)

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
        workers = self._workers
        if workers is None or (workers.owner, workers.count) != (os.getpid(), processes):
            workers = self._workers = _Workers(self, processes)
            weakref.finalize(self, workers.close)
        step, taken = shares * processes, [0] * processes  # batches that each process has made

        def begin(which: int) -> None:
            """Let a process make the batches that were not taken yet."""
            row = first + taken[which] * step * self.batch
            workers.begin(which, self, (row, share + shares * which, step, processes * readers))

        def next_of(which: int) -> tuple[int, int]:
            """Wait for a batch; where a signal ended its process, another one makes it again."""
            try:
                return workers.answer(which)
            except LostWorkerError as error:
                if not error.by_signal:
                    raise
            try:
                del workers.started[which]
                begin(which)
                return workers.answer(which)
            except LostWorkerError as error:
                row = first + (taken[which] * step + share + shares * which) * self.batch
                raise error.of(f"rows {row} to {row + self.batch - 1}") from None

        try:
            for which in range(processes):
                workers.rest(which)
                begin(which)
            for which in cycle(range(processes)):
                slot, rows = next_of(which)
                if not rows:
                    workers.memory.free.append(slot)
                    return
                taken[which] += 1
                following = workers.memory.free_slot()
                workers.ask(which, following, following)
                yield workers.memory.arrays(slot, rows)
        except GeneratorExit:  # the loop ends early
            raise
        except BaseException:
            workers.close()
            raise

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
        self.free, self._maps = list[int](), dict[int, mmap.mmap]()

    def free_slot(self) -> int:
        """Return the number of a free slot, perhaps a new one."""
        if self.free:
            return self.free.pop()
        slot = len(self._maps)
        os.ftruncate(self.file, (slot + 1) * self._size)
        self._open(slot)
        return slot

    def arrays(self, slot: int, rows: int) -> dict[str, Array]:
        """Return the first rows of a slot, by field."""
        whole = np.frombuffer(self._open(slot), np.uint8)
        weakref.finalize(whole, self.free.append, slot)
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

    def __init__(self, stream: RowStream, file: int) -> None:
        """Take a stream, and the descriptor of the memory."""
        self._stream, self._file = stream, file
        self._memory: _Memory | None = None

    def __call__(self, asked: int | tuple[int, int, int, int]) -> int:
        """Return how many rows were written to a slot; 0 at the end of the share.

        The first arguments of `made` begin another share.
        """
        if isinstance(asked, tuple):
            memory = self._memory = self._memory or _Memory(self._stream, self._file)
            self._batches = self._stream.made(*asked, lambda rows: memory.arrays(self._slot, rows))
            return 0
        self._slot = asked
        return len(next(iter(next(self._batches, {"": ()}).values())))


class _Workers:
    """Processes that make batches of a stream, loop after loop, and the memory that they share."""

    def __init__(self, stream: RowStream, count: int) -> None:
        self.memory = _Memory(stream, _unnamed_file())
        self.owner, self.count, self.started = os.getpid(), count, dict[int, Process]()
        # Slots that each was asked to fill, -1 for what needs none, and whose answers are due.
        self.asked = [deque[int]() for _ in range(count)]

    def ask(self, which: int, slot: int, message: Any) -> None:
        """Hand a message over to a process."""
        self.asked[which].append(slot)
        with suppress(LostWorkerError):  # `answer` meets it
            self.started[which].ask(pickle.dumps(message))

    def begin(self, which: int, stream: RowStream, part: tuple[int, int, int, int]) -> None:
        """Let a process, a new one where there is none, make a share, in AHEAD slots."""
        slots = [slot for slot in self.asked[which] if slot >= 0]
        self.asked[which].clear()
        if which not in self.started:
            self.started[which] = Process([self.memory.file])
            self.ask(which, -1, _Filler(stream, self.memory.file))
        self.ask(which, -1, part)
        for slot in slots or [self.memory.free_slot() for _ in range(AHEAD)]:
            self.ask(which, slot, slot)

    def answer(self, which: int) -> tuple[int, int]:
        """Return the oldest slot of a process, and how many rows are in it."""
        while True:
            succeeded, result = self.started[which].heard()
            if not succeeded:
                raise result
            slot = self.asked[which].popleft()
            if slot >= 0:
                return slot, int(result)

    def rest(self, which: int) -> None:
        """Wait until a process has done what nobody wants any more."""
        with suppress(LostWorkerError):
            while which in self.started and self.asked[which]:
                self.started[which].heard()
                self.memory.free += [slot for slot in (self.asked[which].popleft(),) if slot >= 0]
        if self.asked[which]:
            del self.started[which]

    def close(self) -> None:
        """End the processes, unless this is a fork, and let the memory go."""
        if os.getpid() == self.owner and self.count:
            self.count = 0
            for process in self.started.values():
                process.kill()
                process.end()
            os.close(self.memory.file)


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

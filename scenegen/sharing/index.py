"""The index of some files: a Parquet file with a line for each row, and no pixels."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from scenegen.common.errors import FileFormatError
from scenegen.files.content import ColumnDigest, row_digest
from scenegen.files.rows import RowFile
from scenegen.files.schema import Column
from scenegen.sharing.formats import write_parquet
from scenegen.sharing.task import Line, Tally, Task, stored_blocks

INDEX = "index.parquet"
GROUP_ROWS = 1000  # of a row group
PLACES = (
    Column("file", (), "text", meaning="name of the file to open; of a set, the file that shows all"
           " shards as one"),
    Column("row", (), "int64", meaning="row in that file, or in its part, from 0"),
    Column("shard", (), "text", meaning="name of the file that holds the row: the same, or a"
           " shard"),
    Column("shard_row", (), "int64", meaning="row in that file, or in its part, from 0"),
)  # fmt: skip


def index_columns(task: Task) -> tuple[Column, ...]:
    """Return all columns of a line, in their order."""
    what = "as it is stored: numbers in C order, little-endian; text in UTF-8 and a zero byte"
    digests = [
        Column(f"{name}_sha256", (), "text", meaning=f"SHA-256 of the row's {name} {what}")
        for name in task.digested
    ]
    return (*PLACES, *task.columns, *digests)


def write_index(
    path: Path,
    task: Task,
    tables: Sequence[RowFile],
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Tally]:
    """Write the index of some open tables; return what each of them holds.

    All values are read once, and compared with the digests of those that were written.

    Raises FileFormatError where a row is damaged or values are not those that were written.
    """
    tallies = [Tally(counters={title: Counter() for title in task.counts}) for _ in tables]
    lines = _counted(task, tables, tallies, progress)
    columns = index_columns(task)
    groups = iter(lambda: list(islice(lines, GROUP_ROWS)), [])
    blocks = ({c.name: [line[c.name] for line in group] for c in columns} for group in groups)
    write_parquet(path, columns, blocks, arrays=False)
    return tallies


def _counted(
    task: Task, tables: Sequence[RowFile], tallies: list[Tally], progress: Callable[[int], Any]
) -> Iterator[Line]:
    """Yield the lines of all tables, and count them."""
    for file, tally in zip(tables, tallies, strict=True):
        for line in _lines(task, file):
            tally.rows += 1
            tally.digests.add(line[f"{task.same}_sha256"])
            for title, keys in task.counts.items():
                tally.counters[title].update(keys(line))
            progress(1)
            yield line


def _lines(task: Task, file: RowFile) -> Iterator[Line]:
    """Yield the lines of one table; check at the end that its digests are those that are stored."""
    places = ((path.name, row) for path, count in file.parts for row in range(count))
    digests = {name: ColumnDigest() for name in file.fields}
    for block in stored_blocks(file, range(len(file))):
        for row, values in block:
            marks = {name: row_digest(value) for name, value in values.items()}
            for name, mark in marks.items():
                digests[name].add(mark)
            shard, shard_row = next(places)
            yield {
                "file": file.path.name,
                "row": row,
                "shard": shard,
                "shard_row": shard_row,
                **task.line(file, values),
                **{f"{name}_sha256": marks[name].hex() for name in task.digested},
            }
    for name, written in file.stored_digests().items():
        if digests[name].hex != written:
            problem = f"values of {name} that are not those which were written"
            raise FileFormatError(file.path, problem, "", f"{task.verify} tells which")


def counts_table(
    task: Task, names: Sequence[str], tallies: Sequence[Tally]
) -> list[tuple[str, ...]]:
    """Return how many rows there are and what was counted, with a column for each table."""
    counts = [
        (title, *(_shown(tally.counters[title]) for tally in tallies)) for title in task.counts
    ]
    return [("what", *names), (task.unit, *(str(tally.rows) for tally in tallies)), *counts]


def _shown(counter: Counter[Any], most: int = 200) -> str:
    counts = [f"{key}: {number}" for key, number in sorted(counter.items())]
    more = [f"and {len(counts) - most} more"] if len(counts) > most else []
    return ", ".join(counts[:most] + more) or "not told"

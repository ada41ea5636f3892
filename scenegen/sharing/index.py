"""The index of some files: a Parquet file with a line for each row, and no pixels."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from scenegen.common.errors import FileFormatError
from scenegen.files.content import ColumnDigest, row_digest
from scenegen.files.rows import RowFile
from scenegen.files.schema import Column
from scenegen.sharing.stored import as_text, stored_blocks

Line = dict[str, Any]
GROUP_ROWS = 1000  # of a row group
PLACES = (
    Column("file", (), "text", meaning="name of the file to open; of a set, the file that shows all"
           " shards as one"),
    Column("row", (), "int64", meaning="row in that file, or in its part, from 0"),
    Column("shard", (), "text", meaning="name of the file that holds the row: the same, or a"
           " shard"),
    Column("shard_row", (), "int64", meaning="row in that file, or in its part, from 0"),
)  # fmt: skip


@dataclass(frozen=True)
class IndexKind:
    """What the index of a kind of files holds.

    Attributes:
        columns: of a line, besides PLACES and digests; -1 in a shape stands for any length.
        digested: columns of the files whose rows' SHA-256 is in a line.
        line: returns the values of `columns` from an open file and the stored values of a row.
        counts: by title, what to count of a line; a line may count several times, or not at all.
        same: name of the digest that rows share which show the same.
        verify: command that tells which rows were changed.
    """

    columns: Sequence[Column]
    digested: Sequence[str]
    line: Callable[[Any, Mapping[str, Any]], Line]
    counts: Mapping[str, Callable[[Line], Iterable[Any]]]
    same: str
    verify: str

    @property
    def all_columns(self) -> tuple[Column, ...]:
        """All columns of a line, in their order."""
        what = "as it is stored: numbers in C order, little-endian; text in UTF-8 and a zero byte"
        digests = [
            Column(f"{name}_sha256", (), "text", meaning=f"SHA-256 of the row's {name} {what}")
            for name in self.digested
        ]
        return (*PLACES, *self.columns, *digests)


@dataclass
class Tally:
    """What the rows of one table hold: their number, what was counted, and how many differ.

    Attributes:
        digests: of what the rows show, as hex.
    """

    rows: int = 0
    counters: dict[str, Counter[Any]] = field(default_factory=dict)
    digests: set[str] = field(default_factory=set)


def write_index(
    path: Path,
    kind: IndexKind,
    tables: Iterable[Callable[[], RowFile]],
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Tally]:
    """Write the index of some tables, each opened in its turn; return what each of them holds.

    All values are read once, and compared with the digests of those that were written.

    Raises whatever opening a table raises, and FileFormatError where a row is damaged or values are
    not those that were written.
    """
    from scenegen.sharing.parquet import write_parquet

    tallies: list[Tally] = []
    lines = _counted(kind, tables, tallies, progress)
    names = [column.name for column in kind.all_columns]
    groups = iter(lambda: list(islice(lines, GROUP_ROWS)), [])
    blocks = ({name: [line[name] for line in group] for name in names} for group in groups)
    write_parquet(path, kind.all_columns, blocks, arrays=False)
    return tallies


def _counted(
    kind: IndexKind,
    tables: Iterable[Callable[[], RowFile]],
    tallies: list[Tally],
    progress: Callable[[int], Any],
) -> Iterator[Line]:
    """Yield the lines of all tables; append a tally of each table's lines."""
    for opened in tables:
        tally = Tally(counters={title: Counter() for title in kind.counts})
        tallies.append(tally)
        with opened() as file:
            for line in _lines(kind, file):
                tally.rows += 1
                tally.digests.add(line[kind.same])
                for title, keys in kind.counts.items():
                    tally.counters[title].update(keys(line))
                progress(1)
                yield line


def _lines(kind: IndexKind, file: RowFile) -> Iterator[Line]:
    """Yield the lines of one table; check at the end that its digests are those that are stored."""
    places = ((path.name, row) for path, count in file.parts for row in range(count))
    digests = {name: ColumnDigest() for name in file.fields}
    for numbers, stored in stored_blocks(file, range(len(file))):
        for row, values in zip(numbers, stored, strict=True):
            marks = {name: row_digest(value) for name, value in values.items()}
            for name, mark in marks.items():
                digests[name].add(mark)
            texts = {name: as_text(value, file.place(name, row)) for name, value in values.items()}
            shard, shard_row = next(places)
            yield {
                "file": file.path.name,
                "row": row,
                "shard": shard,
                "shard_row": shard_row,
                **kind.line(file, texts),
                **{f"{name}_sha256": marks[name].hex() for name in kind.digested},
            }
    for name, written in file.stored_digests().items():
        if digests[name].hex != written:
            problem = f"values of {name} that are not those which were written"
            raise FileFormatError(file.path, problem, "", f"{kind.verify} tells which")


def counts_table(
    unit: str, names: Sequence[str], tallies: Sequence[Tally]
) -> list[tuple[str, ...]]:
    """Return how many rows there are and what was counted, with a column for each table."""
    counts = [
        (title, *(_shown(tally.counters[title]) for tally in tallies))
        for title in tallies[0].counters
    ]
    return [("what", *names), (unit, *(str(tally.rows) for tally in tallies)), *counts]


def _shown(counter: Counter[Any], most: int = 200) -> str:
    counts = [f"{key}: {number}" for key, number in sorted(counter.items())]
    more = [f"and {len(counts) - most} more"] if len(counts) > most else []
    return ", ".join(counts[:most] + more) or "not told"

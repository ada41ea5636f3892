"""What files hold, as data: their tables, and how many rows are cut into shards.

A task tells of its files in `Piece`s, and adds only the rows. Rows go to whole files, or to shards
beside a file that shows them as one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

from scenegen.common.records import check
from scenegen.files.content import fingerprint, joint_digest
from scenegen.files.schema import Column
from scenegen.files.sets.shards import MOST_SHARDS, shard_name


@dataclass(frozen=True)
class Sheet:
    """One table of a file.

    Attributes:
        columns: its data sets.
        file: number of the file among those of its piece.
        group: HDF5 group that holds the columns; empty for the root.
        attributes: of the group.
    """

    columns: Sequence[Column]
    file: int = 0
    group: str = ""
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def paths(self) -> dict[str, Column]:
        """Return the columns by the names of their data sets in the file."""
        return {f"{self.group}/{column.name}".lstrip("/"): column for column in self.columns}


@dataclass(frozen=True)
class Mark:
    """A root attribute that tells files of different rows apart.

    Attributes:
        name: of the attribute.
        columns: names of those whose values count.
        files: numbers of the files of a piece that have it.
        request: the text that counts too, for a fingerprint; None for a digest of values alone.
    """

    name: str
    columns: Sequence[str]
    files: Sequence[int] = (0,)
    request: str | None = None

    def value(self, digests: Mapping[str, str]) -> str:
        """Return the mark, given the digests of all columns by name."""
        chosen = {name: digests[name] for name in self.columns}
        return joint_digest(chosen) if self.request is None else fingerprint(self.request, chosen)


@dataclass(frozen=True)
class Part:
    """Items whose rows go to the same tables, as many rows to each.

    Attributes:
        of, name: which part it is, for the task; `Shard.part` has the name.
        items: their number.
        sheets: the tables.
        marks: what follows from the rows.
        item_rows: rows of an item in each table.
        noun: what items are, for errors.
    """

    of: str
    name: str
    items: int
    sheets: Sequence[Sheet]
    marks: Sequence[Mark] = ()
    item_rows: int = 1
    noun: str = "questions"


@dataclass(frozen=True)
class Block:
    """Some items of a part, counted from 0."""

    part: Part
    items: range

    @property
    def rows(self) -> int:
        """Number of rows in each table."""
        return len(self.items) * self.part.item_rows

    def __str__(self) -> str:
        of_part = " ".join(filter(None, (self.part.of, self.part.name, self.part.noun)))
        return f"{of_part} {self.items[0]} to {self.items[-1]}"

    def cut(self, size: int) -> Iterator["Block"]:
        """Yield blocks of at most `size` items."""
        for start in self.items[::size]:
            yield replace(self, items=range(start, min(start + size, self.items.stop)))


@dataclass(frozen=True)
class Piece:
    """Files that are filled together, such as those of test questions and of their answers.

    Attributes:
        files: their names, with the root attributes of each.
        blocks: the items that they hold.
        is_shard: whether they are shards of other files; they then hold one block.
    """

    files: Mapping[str, Mapping[str, Any]]
    blocks: Sequence[Block]
    is_shard: bool = False

    @property
    def rows(self) -> int:
        """Number of rows in each of its tables, in all."""
        return sum(block.rows for block in self.blocks)

    def cut(self, size: int) -> "list[Piece]":
        """Return the files themselves where there are at most `size` items, else their shards.

        Raises SpecError where there would be too many shards.
        """
        items = sum(len(block.items) for block in self.blocks)
        if items <= size:
            return [self]
        least = -(-items // (MOST_SHARDS - len(self.blocks) + 1))
        check(size >= least, "shard-size", size, f"at least {least} for {items:,} items")
        shards = [shard for block in self.blocks for shard in block.cut(size)]
        return [
            Piece({_of_shard(name, i, len(shards)): self.files[name] for name in self.files},
                  [shard], is_shard=True)
            for i, shard in enumerate(shards)
        ]  # fmt: skip


def whole(files: Mapping[str, Mapping[str, Any]], parts: Sequence[Part]) -> Piece:
    """Return files with all items of some parts."""
    return Piece(files, [Block(part, range(part.items)) for part in parts])


def _of_shard(name: str, number: int, count: int) -> str:
    return PurePosixPath(name).with_name(shard_name(name, number, count)).as_posix()

"""What a set of files holds, as data: its tables, and how they are cut into shards.

A set answers one request. Its rows go to whole files, or to shards beside a file that shows them as
one. A task says all of that in a `Plan`, and adds only the rows.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
        file: number of the file among those of its bundle.
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
        files: numbers of the files in a bundle that have it.
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
        bundle, name: which part it is, for the task; `Shard.part` has the name.
        items: their number.
        sheets: the tables.
        marks: what follows from the rows.
        item_rows: rows of an item in each table.
        noun: what items are, for errors.
    """

    bundle: str
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
        of_part = " ".join(filter(None, (self.part.bundle, self.part.name, self.part.noun)))
        return f"{of_part} {self.items[0]} to {self.items[-1]}"

    def cut(self, size: int) -> Iterator["Block"]:
        """Yield blocks of at most `size` items."""
        for start in self.items[::size]:
            yield replace(self, items=range(start, min(start + size, self.items.stop)))


@dataclass(frozen=True)
class Bundle:
    """Files that are filled together, such as the file of test questions and that of their answers.

    Attributes:
        files: the names that readers open, with the root attributes of each file.
        parts: what they hold.
    """

    files: Mapping[str, Mapping[str, Any]]
    parts: Sequence[Part]

    def whole(self) -> "Piece":
        """Return the whole bundle as one piece."""
        blocks = tuple(Block(part, range(part.items)) for part in self.parts)
        return Piece(self, tuple(self.files), blocks, False)

    def pieces(self, size: int) -> "list[Piece]":
        """Return one piece where there are at most `size` items, else shards, each of one part.

        Raises SpecError where there would be too many shards.
        """
        whole = self.whole()
        items = sum(len(block.items) for block in whole.blocks)
        if items <= size:
            return [whole]
        least = -(-items // (MOST_SHARDS - len(self.parts) + 1))
        check(size >= least, "shard-size", size, f"at least {least} for {items:,} items")
        shards = [shard for block in whole.blocks for shard in block.cut(size)]
        names = [
            tuple(shard_name(name, number, len(shards)) for name in self.files)
            for number in range(len(shards))
        ]
        return [
            Piece(self, of_shard, (shard,), True)
            for of_shard, shard in zip(names, shards, strict=True)
        ]


@dataclass(frozen=True)
class Piece:
    """Files that one call makes: those of a bundle, or a shard of each of them.

    Attributes:
        names: of the files, one for each file of the bundle.
        blocks: the items that they hold; of a shard one block.
    """

    bundle: Bundle
    names: tuple[str, ...]
    blocks: tuple[Block, ...]
    is_shard: bool

    @property
    def rows(self) -> int:
        """Number of rows in each of its tables, in all."""
        return sum(block.rows for block in self.blocks)


@dataclass(frozen=True)
class Plan:
    """What a set holds, and what its bytes depend on.

    Attributes:
        kind: the attribute `format` of its files.
        spec: the request as JSON, without what must stay secret.
        settings: what else the bytes depend on.
        compression: as in `table.COMPRESSIONS`.
        bundles: all files.
    """

    kind: str
    spec: str
    settings: Mapping[str, str]
    compression: str
    bundles: Sequence[Bundle]

    @property
    def files(self) -> list[str]:
        """Return the names of all files that readers open."""
        return [name for bundle in self.bundles for name in bundle.files]

    def request(self, shard_size: int) -> dict[str, Any]:
        """Return what the bytes of the files depend on."""
        count = sum(part.items for bundle in self.bundles for part in bundle.parts)
        names = {"files": ", ".join(self.files), "kind": self.kind}
        how = {"compression": self.compression, "n": count, "shard-size": shard_size}
        return {**json.loads(self.spec), **self.settings, **names, **how}

"""The named benchmarks, for rooms and for questions: `known_tests.csv`.

The benchmark knows a set by the digest of its truth, wherever its files lie. `bench sets make NAME`
prints the digests of what it makes. A set whose digest changes gets a new version. The old one
stays listed, so that scores on it keep their name. Sets that take hours are made in shards, because
an interrupted command keeps those that are complete.
"""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

Task = Literal["rooms", "iqtt", "measured"]


@dataclass(frozen=True)
class KnownTest:
    """A file of a test set.

    Attributes:
        name: of the set, with its version; `set/part` for a file of several.
        digest: `Meta.truth_digest` of its scores.
        rows: how many images or questions it has.
        command: what makes the set, but for its place.
        purpose: what it is for.
        pictures: digest of the images; empty where they differ between machines by rounding, and
            `scenegen verify` or `iqtt audit` compares them.
        superseded: whether older code made it, whose bits were others.
    """

    name: str
    task: Task
    digest: str
    rows: int
    command: str
    purpose: str = ""
    pictures: str = ""
    superseded: bool = False

    @property
    def file(self) -> str:
        """Where the file lies in the folder to which the set is made."""
        part = self.name.partition("/")[2]
        return f"{part}/iqtt-test-answers.h5" if part else f"{self.name}.h5"


def _read() -> Iterator[KnownTest]:
    path = Path(__file__).with_suffix(".csv")
    with path.open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            values: dict[str, Any] = {**line, "rows": int(line["rows"])}
            yield KnownTest(**values | {"superseded": bool(line["superseded"])})


KNOWN_TESTS = tuple(_read())


def known_test(digest: str) -> KnownTest | None:
    """Return the test set of this digest, if it is known."""
    return next((test for test in KNOWN_TESTS if test.digest == digest), None)


def sets() -> dict[str, list[KnownTest]]:
    """Return the files of each set that can be made, by its name."""
    found: dict[str, list[KnownTest]] = {}
    for test in KNOWN_TESTS:
        if not test.superseded:
            found.setdefault(test.name.partition("/")[0], []).append(test)
    return found

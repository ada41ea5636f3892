"""Test sets that the benchmark knows by the digest of their truth, wherever their files lie."""

from dataclasses import dataclass
from typing import Literal

Task = Literal["rooms", "iqtt"]


@dataclass(frozen=True)
class KnownTest:
    """A test set.

    Attributes:
        name: for tables.
        digest: `Meta.truth_digest` of its scores.
        rows: how many images or questions it has.
        command: what made it.
    """

    name: str
    task: Task
    digest: str
    rows: int
    command: str


# Rendered by Mitsuba 3.9.1 and Dr.Jit 1.5.0 with LLVM 23.1.4. Others may round depths differently:
# their files are other test sets, as scores may differ in their last digits.
KNOWN_TESTS = (
    KnownTest(
        "examples/sample",
        "rooms",
        "6d2a4170b2a42be92410c52c81a2c56d108523820a988704564a7e9b22ee0f4b",
        8,
        "scenegen render --n 8 --size 48 --out rooms.h5",
    ),
    KnownTest(
        "1,000 rooms, seed 1000",
        "rooms",
        "db8c4f30cf0da0c6ce37c09c642b25af9d6e10eb4bca11efb4ef5ca919824107",
        1000,
        "scenegen render --n 1000 --seed 1000",
    ),
    KnownTest(
        "300 rooms of the README",
        "rooms",
        "f40106593f40af3e40f298efbd74f7abade2909a6c6edfd182151279e2c50c06",
        1500,
        "scenegen render --preset shapes --views 0,5,35,55,80 --n 300 --seed 1000 --size 64",
    ),
    KnownTest(
        "test-shapes-single",
        "rooms",
        "d5464a3807a180002dfc0bddf5c1745d862564c15874223e64a990292a8bf3dc",
        5000,
        "scenegen render --preset shapes-single --n 1000 --views 0,5,35,55,80 --seed 1000",
    ),
    KnownTest(
        "test-shapes",
        "rooms",
        "d025e6fc432363c08b068a8b0573ceacbcc2d9d0efa6d90ec4fabaded989b634",
        5000,
        "scenegen render --preset shapes --n 1000 --views 0,5,35,55,80 --seed 1000",
    ),
    KnownTest(
        "test-shapenet",
        "rooms",
        "bfa4bdaf2f5c1e64a81c8299ca20da9f3599b825b97e2162e91170529cf5fe67",
        5000,
        "scenegen render --preset shapenet --object-split test "
        "--n 1000 --views 0,5,35,55,80 --seed 1000",
    ),
)


def known_test(digest: str) -> KnownTest | None:
    """Return the test set of this digest, if it is known."""
    return next((test for test in KNOWN_TESTS if test.digest == digest), None)

"""The named test sets: one table of them, for rooms and for questions.

The benchmark knows a set by the digest of its truth, wherever its files lie. A set whose digest
changes gets a new version; the old one stays listed, so that scores on it keep their name.
"""

from dataclasses import dataclass
from typing import Literal

Task = Literal["rooms", "iqtt"]


@dataclass(frozen=True)
class KnownTest:
    """A file of a test set.

    Attributes:
        name: of the set, with its version; `set/part` for a file of several.
        digest: `Meta.truth_digest` of its scores.
        rows: how many images or questions it has.
        command: what makes the set, but for its place.
        purpose: what it is for.
        superseded: whether older code made it, whose bits were others.
    """

    name: str
    task: Task
    digest: str
    rows: int
    command: str
    purpose: str = ""
    superseded: bool = False

    @property
    def file(self) -> str:
        """Where the file lies in the folder to which the set is made."""
        part = self.name.partition("/")[2]
        return f"{part}/iqtt-test-answers.h5" if part else f"{self.name}.h5"


_RENDER = "scenegen render --n 300 --seed 1000 --views 0,5,35,55,80"
_QUESTIONS = "iqtt make-split --preset suite --train 0 --labeled 0 --val 0 --test 500"
# The digests of the six files of rotation-1. `bench sets make rotation-1` prints those it makes.
_ROTATION_1 = {
    "matched": "",
    "mirror-pair": "",
    "mirror-pair-2": "",
    "other": "",
    "near": "",
    "mirror": "",
}
KNOWN_TESTS = (
    KnownTest(
        "sample-1",
        "rooms",
        "",
        8,
        "scenegen render --n 8 --size 48",
        "the rooms in examples/sample",
    ),
    KnownTest(
        "rooms-1", "rooms", "", 1500, f"{_RENDER} --size 64", "the headline: rooms of basic shapes"
    ),
    KnownTest(
        "rooms-shadows-1",
        "rooms",
        "",
        1500,
        f"{_RENDER} --size 64 --shadows",
        "rooms-1 where objects cast shadows",
    ),
    KnownTest("rooms-128-1", "rooms", "", 1500, _RENDER, "rooms-1 at 128 pixels"),
    KnownTest(
        "objects-1",
        "rooms",
        "",
        1500,
        f"{_RENDER} --size 64 --preset shapenet --object-split test",
        "rooms of built-in objects that no training set shows",
    ),
    *(
        KnownTest(f"rotation-1/{kind}", "iqtt", digest, 500, _QUESTIONS, "mental rotation, by kind")
        for kind, digest in _ROTATION_1.items()
    ),
    KnownTest(
        "examples/sample",
        "rooms",
        "6d2a4170b2a42be92410c52c81a2c56d108523820a988704564a7e9b22ee0f4b",
        8,
        "scenegen render --n 8 --size 48 --out rooms.h5",
        superseded=True,
    ),
    KnownTest(
        "1,000 rooms, seed 1000",
        "rooms",
        "db8c4f30cf0da0c6ce37c09c642b25af9d6e10eb4bca11efb4ef5ca919824107",
        1000,
        "scenegen render --n 1000 --seed 1000",
        superseded=True,
    ),
    KnownTest(
        "300 rooms of the README",
        "rooms",
        "f40106593f40af3e40f298efbd74f7abade2909a6c6edfd182151279e2c50c06",
        1500,
        "scenegen render --preset shapes --views 0,5,35,55,80 --n 300 --seed 1000 --size 64",
        superseded=True,
    ),
    KnownTest(
        "test-shapes-single",
        "rooms",
        "d5464a3807a180002dfc0bddf5c1745d862564c15874223e64a990292a8bf3dc",
        5000,
        "scenegen render --preset shapes-single --n 1000 --views 0,5,35,55,80 --seed 1000",
        superseded=True,
    ),
    KnownTest(
        "test-shapes",
        "rooms",
        "d025e6fc432363c08b068a8b0573ceacbcc2d9d0efa6d90ec4fabaded989b634",
        5000,
        "scenegen render --preset shapes --n 1000 --views 0,5,35,55,80 --seed 1000",
        superseded=True,
    ),
    KnownTest(
        "test-shapenet",
        "rooms",
        "bfa4bdaf2f5c1e64a81c8299ca20da9f3599b825b97e2162e91170529cf5fe67",
        5000,
        "scenegen render --preset shapenet --object-split test "
        "--n 1000 --views 0,5,35,55,80 --seed 1000",
        superseded=True,
    ),
)


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

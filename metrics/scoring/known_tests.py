"""Test sets that the benchmark knows by the digest of their truth, wherever their files lie."""

from dataclasses import dataclass

from metrics.scoring.records import Task


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
        "0e194769a7c81a70b9e02670e315fd7eca4eb27da765c258be1d4696503b4270",
        8,
        "scenegen render --n 8 --size 48 --out rooms.h5",
    ),
    KnownTest(
        "1,000 rooms, seed 1000",
        "rooms",
        "872faa79bffeaf8cd5e103b303586fe188d642d7746d98c6bf0b55d0191b4c20",
        1000,
        "scenegen render --n 1000 --seed 1000",
    ),
    KnownTest(
        "300 rooms of the README",
        "rooms",
        "6db10483ae3f48792f0c64639823c02498cc90a8cf8ff50ffaf7475bee2f3861",
        1500,
        "scenegen render --preset shapes --views 0,5,35,55,80 --n 300 --seed 1000 --size 64",
    ),
    KnownTest(
        "test-shapes-single",
        "rooms",
        "bb1c407112d04324ac2cfc4510ad6a025a75da81d87a8e56a7a2c91bdd6c1c73",
        5000,
        "scenegen render --preset shapes-single --n 1000 --views 0,5,35,55,80 --seed 1000",
    ),
    KnownTest(
        "test-shapes",
        "rooms",
        "d5062263404607f50256d7a8f8b1be3d15d1137054a83101f4f63d097cb957c3",
        5000,
        "scenegen render --preset shapes --n 1000 --views 0,5,35,55,80 --seed 1000",
    ),
    KnownTest(
        "test-shapenet",
        "rooms",
        "7ee1310c97416bc5c6d4474499a3165d905b4c43b6f67cff5839353e824f1f56",
        5000,
        "scenegen render --preset shapenet --object-split test "
        "--n 1000 --views 0,5,35,55,80 --seed 1000",
    ),
)


def known_test(digest: str) -> KnownTest | None:
    """Return the test set of this digest, if it is known."""
    return next((test for test in KNOWN_TESTS if test.digest == digest), None)

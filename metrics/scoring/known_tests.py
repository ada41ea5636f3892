"""Test sets that the benchmark knows by the digest of their truth, wherever their files lie."""

from dataclasses import dataclass

from metrics.scoring.records import Task


@dataclass(frozen=True)
class KnownTest:
    """A test set.

    Attributes:
        name: for tables.
        digest: `Meta.truth_digest` of its scores.
        command: what made it.
    """

    name: str
    task: Task
    digest: str
    command: str


KNOWN_TESTS = (
    KnownTest(
        "examples/sample",
        "rooms",
        "0e194769a7c81a70b9e02670e315fd7eca4eb27da765c258be1d4696503b4270",
        "scenegen render --n 8 --size 48 --out rooms.h5",
    ),
)


def known_test(digest: str) -> KnownTest | None:
    """Return the test set of this digest, if it is known."""
    return next((test for test in KNOWN_TESTS if test.digest == digest), None)

"""What can be wrong with a submission, as data: found by the reader, the writer and `validate`."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice

from scenegen.common.errors import SceneGenError

MOST_IDS = 5
HINT = "hint"


class PredictionError(SceneGenError):
    """A prediction that would make a submission invalid."""


@dataclass(frozen=True)
class Problem:
    """One rule that a submission breaks, or a hint.

    Attributes:
        dataset: which dataset or root attribute; "file" or "truth" for those.
        rule: in a word or two, such as "type", "shape", "finite"; "hint" for a hint.
        expected: what the format asks for.
        got: what was found instead.
        ids: the first few rows of the truth (or indices of questions) concerned; empty where all
            are.
    """

    dataset: str
    rule: str
    expected: str
    got: str
    ids: tuple[int, ...] = ()

    @property
    def is_hint(self) -> bool:
        """Whether the submission is valid all the same."""
        return self.rule == HINT

    def __str__(self) -> str:
        """Everything in one line."""
        return f"{self.dataset}: {self.got}{_told(self.ids)}, expected {self.expected}"


def first_ids(ids: Iterable[int]) -> tuple[int, ...]:
    """The first few of some ids, as Python's own integers."""
    return tuple(int(i) for i in islice(ids, MOST_IDS))


def _told(ids: tuple[int, ...]) -> str:
    return f" (ids {', '.join(map(str, ids))})" if ids else ""

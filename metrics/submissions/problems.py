"""What can be wrong with a submission, as data that readers, writers and `validate` share."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Self

from scenegen.common.errors import SceneGenError

MOST_IDS = 5
HINT = "hint"


class PredictionError(SceneGenError):
    """A prediction that would make a submission invalid."""


class JsonError(SceneGenError):
    """A JSON file that is not what it should be; `where` is empty for the whole of it."""

    def inside(self, place: object) -> Self:
        """Return the same error with a file, or a key, before `where`."""
        apart = "" if self.where.startswith("[") else ": "
        where = f"{place}{apart}{self.where}" if self.where else place
        return type(self)(where, self.found, self.expected, self.hint)


@dataclass(frozen=True)
class Problem:
    """One rule that a submission breaks, or a hint.

    Attributes:
        dataset: which dataset or root attribute; "file" or "truth" for those.
        rule: in a word or two, such as "type", "shape", "finite"; "hint" for a hint.
        expected: what the format asks for.
        found: what is there instead.
        ids: the first few rows of the truth, or indices of questions, that are concerned; empty
            where all are.
    """

    dataset: str
    rule: str
    expected: str
    found: str
    ids: tuple[int, ...] = ()

    @property
    def is_hint(self) -> bool:
        """Whether the submission is valid all the same."""
        return self.rule == HINT

    @property
    def found_in_rows(self) -> str:
        """What was found, and in which rows."""
        return self.found + (f" (ids {', '.join(map(str, self.ids))})" if self.ids else "")

    def __str__(self) -> str:
        """Everything in one line."""
        return f"{self.dataset}: {self.found_in_rows}, expected {self.expected}"


def first_error(
    kind: type[SceneGenError], place: object, problems: Sequence[Problem], advice: str = ""
) -> SceneGenError:
    """Return the first problem as an error of this kind; its hint says how many more there are."""
    first, more = problems[0], len(problems) - 1
    others = f"and {more} more problem{'s' * (more > 1)}" if more else ""
    hint = "; ".join(filter(None, (others, advice)))
    return kind(f"{place}: {first.dataset}", first.found_in_rows, first.expected, hint)


def first_ids(ids: Iterable[int]) -> tuple[int, ...]:
    """Return the first few of some ids, as Python's own integers."""
    return tuple(int(i) for i in islice(ids, MOST_IDS))

"""Which questions a participant is asked: drawn at random, balanced over kinds and places."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check

Cell = tuple[str, int]  # kind of a question, and the place of its right answer from 0


def cells_of(
    kinds: Sequence[str], places: Sequence[int], rows: Sequence[int]
) -> dict[Cell, list[int]]:
    """Return the rows of each kind and place; `kinds` and `places` are those of these rows."""
    cells = defaultdict(list)
    for row, kind, place in zip(rows, kinds, places, strict=True):
        cells[kind, place].append(row)
    return dict(sorted(cells.items()))


def draw_rows(
    cells: Mapping[Cell, Sequence[int]], count: int, seed: int, participant: int, attempt: int = 0
) -> list[int]:
    """Return `count` different rows in the order in which they are asked.

    The numbers of questions of each kind differ by at most 1, and so do those with the right answer
    at each place, as long as every cell has questions left. The draw depends on these arguments
    alone.

    Args:
        cells: the rows of each kind and place, as `cells_of` gives them.
        seed: of the study, at least 0.
        participant: from 0.
        attempt: 0 for the questions, 1 for those of the calibration.

    Raises SpecError where there are too few questions.
    """
    there = sum(map(len, cells.values()))
    check(0 <= count <= there, "questions", count, f"at most {there}, as many as there are")
    rng = item_rng(seed, participant, Purpose.QUIZ, attempt)
    of_kind, at_place, in_cell = Counter[str](), Counter[int](), Counter[Cell]()
    drawn: list[int] = []

    def rarity(cell: Cell) -> tuple[int, int]:
        # A cell of the rarest kind and of the rarest place is chosen where there is one, so that
        # no count gets two ahead of another.
        kind, place = cell
        return of_kind[kind] + at_place[place], in_cell[cell]

    for _ in range(count):
        left = [cell for cell in cells if in_cell[cell] < len(cells[cell])]
        chosen = min((left[i] for i in rng.permutation(len(left))), key=rarity)
        rows = cells[chosen]
        row = rows[int(rng.integers(len(rows)))]
        while row in drawn:
            row = rows[int(rng.integers(len(rows)))]
        drawn.append(row)
        of_kind[chosen[0]] += 1
        at_place[chosen[1]] += 1
        in_cell[chosen] += 1
    return [drawn[i] for i in rng.permutation(count)]

"""Proposals in stock: drawn many at once, ahead of need, and taken in order of their items."""

import heapq
from collections import Counter, defaultdict, deque
from collections.abc import Sequence

from scenegen.common.errors import PlacementError
from scenegen.description.scene_arrays import SceneArrays, joined
from scenegen.description.specs import Request
from scenegen.objects.catalogue import Objects
from scenegen.sampling.scenes import MAX_RENDERED, most_attempts, refusal, sample_scenes

AHEAD = 512  # proposals drawn at once: with few, arrays are slow; with many, retries wait
AHEAD_INTERIORS = 16  # closed rooms take long, one by one
RETRIES = 3  # least number of attempts that are drawn at once for an item that needs another


class ProposalQueue:
    """The proposals of items that ascend, each of which is proposed until it is accepted."""

    def __init__(self, spec: Request, items: Sequence[int], objects: Objects) -> None:
        """Draw nothing yet; `objects` are what the scenes are made of."""
        self._spec, self._objects, self._items = spec, objects, items
        self._ahead = AHEAD_INTERIORS if spec.interior else AHEAD
        self._retries = 1 if spec.interior else RETRIES
        self._most = most_attempts(spec)
        self._begun = 0  # items that were proposed at least once
        self._stock: list[int] = []  # a heap of items whose next proposal is known
        self._again: list[int] = []  # a heap of items that need another attempt
        # Of items not yet accepted: scenes with their rows, in order of the attempts.
        self._scenes = defaultdict[int, deque[tuple[SceneArrays, int]]](deque)
        self._attempts, self._taken = Counter[int](), Counter[int]()

    def take(self, count: int, end: int) -> SceneArrays | None:
        """Return the next `count` proposals of items before `end`, fewer if there are no more.

        Raises PlacementError where `most_attempts` proposals of an item were of no use.
        """
        if self._left() and len(self._stock) < self._ahead:
            self._draw()  # before it must be, so that items without room are tried again in time
        rows = defaultdict[int, list[int]](list)
        drawn: dict[int, SceneArrays] = {}
        for _ in range(count):
            while self._again and not self._ready(end):
                self._draw()
            if not self._ready(end):
                break
            item = heapq.heappop(self._stock)
            self._taken[item] += 1
            scenes, row = self._scenes[item].popleft()
            rows[id(scenes)].append(row)
            drawn[id(scenes)] = scenes
        return joined([drawn[key].take(chosen) for key, chosen in rows.items()]) if rows else None

    def accept(self, item: int) -> None:
        """Forget an item: it has its scene."""
        del self._attempts[item], self._taken[item], self._scenes[item]

    def refuse(self, item: int) -> None:
        """Propose an item again, whose last proposal shows too little of some object.

        Raises PlacementError where MAX_RENDERED proposals of it did.
        """
        if self._taken[item] == MAX_RENDERED:
            raise self._refusal(item)
        heapq.heappush(self._stock if self._scenes[item] else self._again, item)

    def _ready(self, end: int) -> bool:
        return bool(self._stock) and self._stock[0] < end

    def _left(self) -> bool:
        return self._begun < len(self._items)

    def _refusal(self, item: int) -> PlacementError:
        problems = self._objects.problems if self._objects else {}
        return refusal(self._spec, item, self._taken[item], self._attempts[item], problems)

    def _draw(self) -> None:
        """Draw as many proposals as are due: of items in need of another attempt, then new ones.

        Of an item that has had n attempts n more are drawn at once, so that an impossible request
        is soon known to be one.
        """
        tries: list[tuple[int, int]] = []  # item, attempt
        while self._again and len(tries) < self._ahead:
            item = heapq.heappop(self._again)
            first = self._attempts[item]
            if first == self._most:
                raise self._refusal(item)
            more = range(first, min(first + max(first, self._retries), self._most))
            tries += [(item, attempt) for attempt in more]
        room = min(
            self._ahead - len(tries),
            2 * self._ahead - len(self._stock),
            len(self._items) - self._begun,
        )
        new = self._items[self._begun : self._begun + max(room, 0)]
        self._begun += len(new)
        tries += [(item, 0) for item in new]
        items, attempts = zip(*tries, strict=True)
        _, scenes = sample_scenes(self._spec, items, attempts, self._objects)
        for row, item in enumerate(scenes.index.tolist()):
            self._scenes[item].append((scenes, row))
        self._attempts.update(item for item, _ in tries)
        for item in {item for item, _ in tries}:
            heapq.heappush(self._stock if self._scenes[item] else self._again, item)

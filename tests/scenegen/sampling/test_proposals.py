"""The queue of proposals: each item's attempts in order, whatever is drawn at once."""

from functools import cache, partial
from typing import Any

import pytest

from scenegen.common.errors import PlacementError
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import objects_of
from scenegen.sampling import proposals
from scenegen.sampling.proposals import ProposalQueue
from scenegen.sampling.scenes import MAX_RENDERED, sample_scene

SPEC = DatasetSpec(objects=(2, 4), seed=9)
ITEMS = range(100, 120)
scene_of = cache(partial(sample_scene, SPEC))


def refused(item, turn):
    """Some items are refused once, a few three times."""
    return turn < (3 if item % 10 == 0 else item % 3 == 0)


def accepted(batch, end):
    """Run a queue dry: each item's position among what was taken, and its scene."""
    queue, turns = ProposalQueue(SPEC, ITEMS, objects_of(SPEC)), dict.fromkeys(ITEMS, 0)
    found: dict[int, tuple[int, Any]] = {}
    while (scenes := queue.take(batch, end)) is not None:
        assert 0 < len(scenes) <= batch
        for row, item in enumerate(scenes.index.tolist()):
            assert item < end
            if refused(item, turns[item]):
                queue.refuse(item)
            else:
                queue.accept(item)
                found[item] = (len(found), scenes.scene(row))
            turns[item] += 1
    return found


@pytest.mark.parametrize(("ahead", "batch"), [(1, 1), (7, 5), (256, 64)])
def test_an_item_gets_its_first_attempt_that_is_not_refused(ahead, batch, monkeypatch):
    monkeypatch.setattr(proposals, "AHEAD", ahead)
    found = accepted(batch, 1000)
    assert sorted(found) == [*ITEMS]
    for item, (_, scene) in found.items():
        attempts = (s for a in range(100) if (s := scene_of(item, a)) is not None)
        for turn, expected in enumerate(attempts):
            if not refused(item, turn):
                assert scene == expected
                break


def test_an_item_that_is_always_refused_ends_the_run():
    queue = ProposalQueue(SPEC, ITEMS, objects_of(SPEC))
    refused_before = 0

    def refuse_the_first():
        nonlocal refused_before
        for _ in range(200):
            scenes = queue.take(4, 104)
            for item in [] if scenes is None else scenes.index.tolist():
                refused_before += item == 100
                (queue.refuse if item == 100 else queue.accept)(item)

    with pytest.raises(PlacementError, match=r"of which were rendered") as refused:
        refuse_the_first()
    assert refused.value.where == "item 100"
    assert refused_before == MAX_RENDERED

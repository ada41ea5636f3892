"""Rooms that differ in one thing: what differs, what does not, and where cameras stand."""

import math

import numpy as np
import pytest

from scenegen.description.presets import preset_spec
from scenegen.objects.catalogue import objects_of
from scenegen.sampling.interiors.alternatives import (
    APART_ON_TOP,
    DIFFERENCES,
    draw_alternatives,
)
from scenegen.sampling.interiors.spaces import Space, apart, clear_of

SPEC = preset_spec("interiors", seed=5, height=64, width=64, objects=(12, 30))


@pytest.fixture(scope="module")
def drawn():
    """Return the first rooms of each difference, 70 degrees apart."""
    objects, found = objects_of(SPEC), {}
    for difference in DIFFERENCES:
        rooms = (
            one
            for index in range(60)
            for one in draw_alternatives(SPEC, index, difference, 70.0, objects)
        )
        found[difference] = next(rooms)
    return found


def boxes(found):
    return [things[found.in_play - 1].box for _, things, *_ in found.rooms]


@pytest.mark.parametrize("difference", DIFFERENCES)
def test_only_what_is_in_play_and_what_it_carries_differs(drawn, difference):
    found = drawn[difference]
    assert len(found.rooms) == 3
    first = found.rooms[0]
    for room in found.rooms[1:]:
        assert room[0] == first[0]
        assert room[2:] == first[2:]
        moved = {
            n
            for n, (a, b) in enumerate(zip(first[1], room[1], strict=True), start=1)
            if (a.box, a.piece.name) != (b.box, b.piece.name)
        }
        assert found.in_play in moved
        assert all(n == found.in_play or first[1][n - 1].stands_on in moved for n in moved)


@pytest.mark.parametrize("difference", DIFFERENCES)
def test_objects_are_apart_and_those_in_play_inside_the_room(drawn, difference):
    for room, things, _, _ in drawn[difference].rooms:
        space = Space(room.size, 99)
        for number, thing in enumerate(things):
            assert space.within(thing.box) or number + 1 != drawn[difference].in_play
            for other in things[:number]:
                below = thing.stands_on and things[thing.stands_on - 1] is other
                good = below and clear_of(other.piece, other.box, thing.box)
                assert apart(thing.box, other.box) or good


def test_moved_objects_are_far_enough_from_each_other_place(drawn):
    places = [(b.x, b.z) for b in boxes(drawn["moved"])]
    assert all(math.dist(a, b) >= APART_ON_TOP for i, a in enumerate(places) for b in places[:i])


def test_turned_objects_keep_their_place_and_face_elsewhere(drawn):
    seen = boxes(drawn["turned"])
    assert len({(box.x, box.z, box.bottom) for box in seen}) == 1
    for i in range(3):
        apart_by = abs(seen[i].turns - seen[i - 1].turns) % 1
        assert 1 / 6 <= apart_by <= 5 / 6


@pytest.mark.parametrize("difference", DIFFERENCES)
def test_both_cameras_look_at_one_point_from_so_many_degrees_apart(drawn, difference):
    for _, _, places, target in drawn[difference].rooms:
        a, b = (np.subtract(place, target)[[0, 2]] for place in places)
        assert math.isclose(np.linalg.norm(a), np.linalg.norm(b))
        cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
        assert math.isclose(math.degrees(math.acos(cosine)), 70, abs_tol=1e-6)


def test_an_item_is_the_same_whenever_it_is_drawn():
    objects = objects_of(SPEC)
    first, again = (
        [list(draw_alternatives(SPEC, i, "turned", -40.0, objects)) for i in range(3)]
        for _ in range(2)
    )
    assert [[x.rooms[0][2:] for x in rooms] for rooms in first] == [
        [x.rooms[0][2:] for x in rooms] for rooms in again
    ]

"""The last bits of cosines, sums and matrix products reach no object that is rendered or placed."""

import math

import numpy as np
import pytest

from scenegen.description.names import FAMILY_NAMES, SHAPE_NAMES
from scenegen.objects import basic_shapes
from scenegen.objects.cast_meshes import corner_table, normal_table, overlapping
from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.objects.families.store import MemberStore
from scenegen.rendering.surfaces.in_numpy import Polyhedron

IN_NUMPY = ("sin", "cos", "tan", "hypot", "arctan2", "einsum")
IN_MATH = ("sin", "cos", "tan", "exp", "log", "hypot", "atan2", "acos")


@pytest.fixture
def noisy(monkeypatch):
    """Return what lets functions that processors and libraries compute differently be off by 1."""
    rng = np.random.default_rng(0)

    def off(function):
        def result(*args, **kwargs):
            values = np.asarray(function(*args, **kwargs), float)
            up = rng.random(values.shape) < 0.5
            moved = np.where(up, np.nextafter(values, np.inf), np.nextafter(values, -np.inf))
            moved = np.where(np.isin(values, (-1, 0, 1)), values, moved)
            return float(moved) if moved.ndim == 0 else moved

        return result

    def start():
        for module, names in ((np, IN_NUMPY), (math, IN_MATH)):
            for name in names:
                monkeypatch.setattr(module, name, off(getattr(module, name)))

    return start


def as_bytes(arrays):
    return [np.asarray(array).tobytes() for array in arrays]


def member(family, number):
    arrays = MemberStore()._made(family, number, "")
    hull = np.column_stack([arrays.pop("hull_points"), arrays.pop("hull_discs")])
    return as_bytes([*arrays.values(), rounded(hull, POINT_STEP)])


@pytest.mark.parametrize(
    "numbers", [range(3), pytest.param(range(3, 1000, 20), marks=pytest.mark.slow)]
)
def test_members_of_families(numbers, noisy):
    some = [(family, number) for family in FAMILY_NAMES for number in numbers]
    before = [member(*one) for one in some]
    noisy()
    assert [one for one, old in zip(some, before, strict=True) if member(*one) != old] == []


def basic(name):
    shape = basic_shapes._BUILDERS[name]()
    hull = np.column_stack([shape.hull_points, shape.hull_discs])
    placed = [rounded(part, POINT_STEP) for part in (hull, shape.resting_directions)]
    if isinstance(shape.surface, Polyhedron):
        return as_bytes([*placed, shape.surface.slabs.astype(np.float32)])
    if shape.surface:
        return as_bytes([*placed, np.float32(list(vars(shape.surface).values()))])
    tables = normal_table(shape), corner_table(shape), np.float32(overlapping(shape.triangles))
    return as_bytes([*placed, *tables])


def test_basic_shapes(noisy):
    before = {name: basic(name) for name in SHAPE_NAMES}
    noisy()
    assert [name for name in SHAPE_NAMES if basic(name) != before[name]] == []

"""Curves, lofts, tubes, boxes and walls, against closed forms."""

import math

import numpy as np
import pytest

from scenegen.objects.families.parts.assembly import assemble
from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.moves import buried, moved, turn_about_x, turn_about_z
from scenegen.objects.families.parts.profiles import arc, line
from scenegen.objects.families.parts.surfaces import loft
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import hollow, ring, shell


def volume(part):
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def test_lofts_have_the_volume_of_their_formula():
    n = 40
    polygon = n / 2 * math.sin(2 * math.pi / n)  # the area of the disc's polygon
    assert volume(loft(line((0.5, 0.0), (0.5, 2.0)))) == pytest.approx(0.5 * polygon)
    cone = loft(line((1.0, 0.0), (0.0, 3.0)))
    assert volume(cone) == pytest.approx(polygon)
    leaning = loft(line((1.0, 0.0), (0.0, 3.0)), lean=(0.5, -0.2))
    assert volume(leaning) == pytest.approx(polygon)
    block = loft(line((1.0, 0.0), (1.0, 2.0)), size=(1.0, 0.5), corner=0.0)
    assert volume(block) == pytest.approx(2 * 1 * 2)
    assert len(block.faces) == 4 * 2 + 2 * 4
    rounded = loft(line((1.0, 0.0), (1.0, 2.0)), size=(1.0, 0.5), corner=0.2)
    assert volume(rounded) == pytest.approx(2 * (2.0 - (4 - polygon) * 0.04))
    four = loft(line((0.1, 0.0), (0.1, 1.0)), at=[(1, 1), (1, -1), (-1, 1), (-1, -1)])
    assert volume(four) == pytest.approx(4 * 0.01 * polygon)
    hoop = loft(ring(line((1.0, 0.0), (1.0, 2.0)), 0.25), closed=True)
    assert volume(hoop) == pytest.approx(2 * polygon * (1 - 0.75**2))


def test_tubes_have_the_volume_and_the_normals_of_a_torus():
    bend = tube(arc((0.0, 0.0), 1.0, 0, 180, 60), 0.2, segments=40)
    assert volume(bend) == pytest.approx(math.pi * math.pi * 0.04, rel=0.01)
    middle = bend.vertices.copy()
    middle[..., 2] = 0.0
    middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
    spokes = (bend.vertices - middle) / 0.2
    on_side = abs(np.linalg.norm(bend.normals - spokes, axis=-1)) < 1e-9
    assert on_side[bend.faces].all(axis=1).mean() > 0.95, "all but the ends"
    flat = tube(line((0.0, 0.0), (3.0, 0.0)), 0.5, 0.1, corner=0.0)
    assert volume(flat) == pytest.approx(3 * 1.0 * 0.2)
    assert np.ptp(flat.vertices[:, 2]) == pytest.approx(1.0), "half_width is across the plane"


def test_boxes_are_flat_and_moves_are_rigid():
    part = boxes([box((0, 0, 0), (1, 2, 3)), box((5, 0, 0), (6, 1, 1), (0.5, 0.5), (0.5, 0.5))])
    assert volume(part) == pytest.approx(6 + (1 + 0.5 + 0.25) / 3)
    np.testing.assert_allclose(np.linalg.norm(part.normals, axis=-1), 1.0)
    turn = turn_about_z(0.3) @ turn_about_x(-1.0)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(turn_about_z(math.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(turn_about_x(math.pi / 2) @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    assert volume(moved(part, (1.0, 2.0, 3.0), turn)) == pytest.approx(volume(part))
    assert len(buried(part).hull_points) == 0


def test_walls_are_as_thick_as_asked():
    """Volumes of a bucket with half a torus as its rim, and of a dome: outside minus inside."""
    polygon = 20 * math.sin(2 * math.pi / 40)
    bucket = loft(hollow(line((1.0, 0.0), (1.0, 2.0)), 0.2))
    rim = 2 * math.pi * 0.9 * math.pi * 0.1**2 / 2
    assert volume(bucket) == pytest.approx(polygon * (2 - 0.64 * 1.8) + rim, rel=0.003)
    dome = loft(shell(arc((0.0, 0.0), 1.0, 0, 90, 24), 0.1), closed=True)
    assert volume(dome) == pytest.approx(2 / 3 * math.pi * (1 - 0.9**3), rel=0.02)


def test_assembled_parts_are_centred_and_scaled():
    pair = [boxes([box((0, 0, 0), (6, 2, 3))]), boxes([box((0, 1, 0), (1, 4, 1))])]
    shape = assemble("pair", pair)
    low, high = shape.triangles.min(axis=(0, 1)), shape.triangles.max(axis=(0, 1))
    np.testing.assert_allclose(low + high, 0.0, atol=1e-12)
    np.testing.assert_allclose((high - low) / (high - low)[0], [1.0, 4 / 6, 0.5])
    assert np.linalg.norm(shape.triangles, axis=-1).max() == pytest.approx(1.0)
    assert len(shape.triangles) == 24

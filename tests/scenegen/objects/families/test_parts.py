"""Curves, lofts, tubes, boxes and walls, against closed forms."""

import math

import numpy as np
import pytest
from shape_checks import DOWN, check_body, unit_vectors

from scenegen.objects.families.parts.assembly import assemble
from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.moves import buried, moved, turn_about_x, turn_about_z
from scenegen.objects.families.parts.profiles import (
    arc,
    bezier,
    fillet,
    hull_rows,
    inset,
    line,
    tightest,
    wave,
)
from scenegen.objects.families.parts.surfaces import loft
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import hollow, ring, shell
from scenegen.objects.solids import UnitShape

CURVES = {
    "line": line((1.0, 0.0), (0.5, 2.0), strips=5),
    "arc": arc((1.0, 2.0), 0.5, -90, 60, 9),
    "ellipse": arc((0.0, 0.0), (2.0, 1.0), 170, 20, 12),
    "bezier": bezier((0.0, 0.0), (1.0, 0.0), (1.5, 1.0), (0.5, 2.0), 12),
    "fillet": fillet([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 3.0)], 0.3),
    "wave": wave((1.0, 0.0), (1.2, 3.0), 0.1, 4),
}


def volume(part):
    a, b, c = (part.triangles[:, i] for i in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("name", CURVES)
def test_tangents_point_along_their_curve(name):
    """A chord lies between the tangents at its ends, or is parallel to both."""
    points, tangents = CURVES[name]
    along = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    chords = np.diff(points, axis=0)
    chords /= np.linalg.norm(chords, axis=1, keepdims=True)
    for ends in (along[:-1], along[1:]):
        assert (ends * chords).sum(axis=1).min() > np.cos(np.radians(20))
    middle = along[:-1] + along[1:]
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    assert (middle * chords).sum(axis=1).min() > np.cos(np.radians(6))


def test_a_fillet_keeps_its_ends_and_its_radius():
    points, _ = CURVES["fillet"]
    np.testing.assert_allclose(points[[0, -1]], [(0.0, 0.0), (0.0, 3.0)], atol=1e-12)
    assert tightest(CURVES["fillet"]) == pytest.approx(0.3, rel=0.02)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).min() > 1e-6


def test_insets_lie_on_the_left_and_meet_at_creases():
    points, _ = inset(arc((0.0, 0.0), 1.0, 0, 90, 8), 0.25)
    np.testing.assert_allclose(np.hypot(*points.T), 0.75, atol=1e-12)
    points, _ = inset(line((1.0, 0.0), (1.0, 2.0), (0.0, 2.0)), 0.25)
    np.testing.assert_allclose(points, [(0.75, 0), (0.75, 1.75), (0.75, 1.75), (0, 1.75)])


def test_hull_rows_are_the_corners_in_any_order():
    corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]
    inner = [(1.0, 0.0), (1.0, 0.5), (2.0, 0.5), (0.0, 0.0), (2.0, 1.0 - 1e-17)]
    points = np.array(corners + inner)
    assert hull_rows(points) == [0, 1, 2, 3]
    found = hull_rows(points[::-1])
    assert {tuple(points[::-1][i]) for i in found} == set(corners)


def test_an_upright_line_keeps_its_ends_although_rounding_bends_it():
    y = np.linspace(0.0, 1.0, 30)
    points = np.stack([0.3 + 1e-17 * np.arange(30) + 5e-17 * (-1) ** np.arange(30), y], axis=1)
    assert {0, 29} <= set(hull_rows(points))


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
    assert len(block.triangles) == 4 * 2 + 2 * 4
    rounded = loft(line((1.0, 0.0), (1.0, 2.0)), size=(1.0, 0.5), corner=0.2)
    assert volume(rounded) == pytest.approx(2 * (2.0 - (4 - polygon) * 0.04))
    four = loft(line((0.1, 0.0), (0.1, 1.0)), at=[(1, 1), (1, -1), (-1, 1), (-1, -1)])
    assert volume(four) == pytest.approx(4 * 0.01 * polygon)
    hoop = loft(ring(line((1.0, 0.0), (1.0, 2.0)), 0.25), closed=True)
    assert volume(hoop) == pytest.approx(2 * polygon * (1 - 0.75**2))


def test_lofted_normals_are_the_smooth_surface_s():
    ball = loft(arc((0.0, 0.0), 1.0, -90, 90, 16))
    np.testing.assert_allclose(ball.normals, ball.triangles, atol=1e-12)
    cone = loft(line((1.0, 0.0), (0.5, 2.0)), lean=(0.25, 0.0))
    side = cone.normals[abs(cone.normals[..., 1]).max(axis=1) < 0.9]
    # On its side at +x the leaning cone is upright, at -x it is not.
    x = side.reshape(-1, 3)
    np.testing.assert_allclose(x[x[:, 0].argmax()], [1.0, 0.0, 0.0], atol=1e-12)
    steep = np.array([-1.0, 0.5, 0.0]) / math.hypot(1.0, 0.5)
    np.testing.assert_allclose(x[x[:, 0].argmin()], steep, atol=1e-12)


def test_tubes_have_the_volume_and_the_normals_of_a_torus():
    bend = tube(arc((0.0, 0.0), 1.0, 0, 180, 60), 0.2, segments=40)
    assert volume(bend) == pytest.approx(math.pi * math.pi * 0.04, rel=0.01)
    middle = bend.triangles.copy()
    middle[..., 2] = 0.0
    middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
    spokes = (bend.triangles - middle) / 0.2
    on_side = abs(np.linalg.norm(bend.normals - spokes, axis=-1)).max(axis=1) < 1e-9
    assert on_side.mean() > 0.95, "all but the ends"
    flat = tube(line((0.0, 0.0), (3.0, 0.0)), 0.5, 0.1, corner=0.0)
    assert volume(flat) == pytest.approx(3 * 1.0 * 0.2)
    assert np.ptp(flat.triangles[..., 2]) == pytest.approx(1.0), "half_width is across the plane"


def test_bodies_hold_their_parts_closely():
    bow = arc((0.0, 0.0), 1.0, 0, 200, 24)
    parts = {
        "loft": loft(CURVES["line"], size=(1.3, 1.0), corner=0.4),
        "copies": loft(line((0.1, 0.0), (0.2, 1.0)), at=[(1, 0), (-1, 0)], lean=(0.1, 0.3)),
        "upright": tube(bow, 0.1, up=(0.0, 1.0, 0.0)),
        "level": tube(bow, 0.2, 0.1, up=(0.0, 0.0, 1.0), corner=0.05),
        "turned": moved(loft(line((0.4, 0.0), (0.2, 1.0))), (1.0, 2.0, 3.0), turn_about_x(0.7)),
        "box": boxes([box((0, 0, 0), (1, 2, 3), (0.5, 0.0), (0.5, 1.0))]),
    }
    for name, part in parts.items():
        mesh = part.triangles, part.normals
        shape = UnitShape(name, lambda: mesh, part.hull_points, part.hull_discs, 0.0, DOWN)
        check_body(shape, part.triangles, 0.02, unit_vectors(200))


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

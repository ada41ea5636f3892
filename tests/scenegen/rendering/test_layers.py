"""Layers against a caster of the test's own, which tries every triangle, and by hand."""

import numpy as np
import pytest

from scenegen.camera import pixel_directions
from scenegen.description.specs import DatasetSpec
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.catalogue import mesh_to_cast, objects_of
from scenegen.rendering.layers import (
    ENTERS,
    LEAVES,
    OPEN,
    Layers,
    _begin_with,
    _surface_crossings,
    layers_of,
    solid_crossings,
    welded,
)
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render
from scenegen.sampling.scenes import sample_scenes

NAN = np.nan


def every_crossing(triangles, directions):
    """Return distances of one ray's crossings with triangles, and their signs (Moller)."""
    a, b, c = triangles.swapaxes(0, 1)
    across = np.cross(directions, c - a)
    size = np.einsum("fi,fi->f", b - a, across)
    with np.errstate(all="ignore"):
        u = np.einsum("fi,fi->f", -a, across) / size
        turned = np.cross(-a, b - a)
        v = turned @ directions / size
        t = np.einsum("fi,fi->f", c - a, turned) / size
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return t[hit], np.where(size[hit] > 0, 1, -1)


def by_brute_force(spec, scene, objects):
    """Return the list of (depth, id, kind) of each pixel's objects, by counting windings."""
    batch = pack(spec, [scene], (0,), objects)
    directions = pixel_directions(spec.height, spec.width, float(batch.fov_y_degrees[0]))
    camera_from_world = np.linalg.inv(batch.world_from_camera[0])
    found = [[] for _ in range(spec.height * spec.width)]
    for k in range(batch.object_count[0]):
        name = batch.names[batch.shape[0, k]]
        mesh = mesh_to_cast(batch.shape_of, name)
        matrix = camera_from_world @ batch.world_from_object[0, k]
        corners = mesh.vertices[mesh.faces].astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
        closed = welded(mesh.vertices, mesh.faces.astype(int))[2].all()
        for pixel, direction in enumerate(directions.reshape(-1, 3)):
            miss = np.cross(direction / np.linalg.norm(direction), matrix[:3, 3])
            if np.linalg.norm(miss) > batch.object_scale[0, k]:
                continue
            inside = 0
            t, signs = every_crossing(corners, direction)
            for i in np.lexsort((-signs, t)):
                before, inside = inside, inside + int(signs[i])
                if not closed:
                    found[pixel].append((t[i], k + 1, OPEN))
                elif (before == 0) != (inside == 0):
                    found[pixel].append((t[i], k + 1, ENTERS if inside else LEAVES))
    return [sorted(along) for along in found], batch


@pytest.mark.parametrize(
    ("source", "shapes"),
    [("shapes", ("cone", "icosahedron", "teapot")),
     ("families", ("bag", "mug", "lamp"))],
)  # fmt: skip
def test_are_those_of_every_triangle(source, shapes):
    spec = DatasetSpec(height=18, width=20, objects=(3, 3), source=source, shapes=shapes, seed=4)
    objects = objects_of(spec)
    layered = 0
    for i in range(3):
        scene = sample_scenes(spec, [i] * 20, range(20), objects)[1].scene(0)
        expected, batch = by_brute_force(spec, scene, objects)
        image = render(batch)
        layers = layers_of(batch, 0, image.depth[0], image.object_id[0])
        np.testing.assert_array_equal(layers.depth[..., 0], image.depth[0])
        np.testing.assert_array_equal(layers.object_id[..., 0], image.object_id[0])
        off = 0
        for pixel, along in enumerate(expected):
            row, column = divmod(pixel, spec.width)
            ids, kinds = (x[row, column] for x in (layers.object_id, layers.entering))
            depth = layers.depth[row, column]
            assert (ids == 0).sum() <= 1
            same = [(k, e) for _, k, e in along] == [
                (k, e) for k, e in zip(ids.tolist(), kinds.tolist(), strict=True) if k > 0
            ]
            near = same and np.allclose(depth[ids > 0], [t for t, _, _ in along], atol=1e-3)
            off += not near
            layered += len(along) > 2
        assert off <= 0.01 * len(expected)  # silhouettes of tessellated shapes
    assert layered > 5


def test_a_ray_crosses_a_torus_four_times():
    surface = unit_shape("torus").surface
    turned = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])  # so that the ray runs along -x
    placed = np.column_stack([turned, -turned @ [2, 0.01, 0.02]])
    found = _surface_crossings(surface, placed, 1, 1, 20.0)
    outer, inner = (np.sqrt((0.68 + r) ** 2 - 0.02**2) for r in tube_at(0.01))
    np.testing.assert_allclose(found.depth, [2 - outer, 2 - inner, 2 + inner, 2 + outer])
    assert found.kind.tolist() == [1, -1, 1, -1]


def tube_at(height):
    half = np.sqrt(0.32**2 - height**2)
    return half, -half


def cube(side, middle):
    """Return the 12 triangles of a cube, counter-clockwise seen from outside."""
    return unit_shape("box").triangles * (side / 2 * np.sqrt(3)) + middle


def along_the_axis(corners, faces=None):
    """Return depth and kind of what the middle pixel of 3 x 3 meets."""
    faces = np.arange(3 * len(corners)).reshape(-1, 3) if faces is None else faces
    found = solid_crossings(*welded(corners.reshape(-1, 3), faces), 3, 3, 20.0)
    at = found.pixel == 4
    order = np.argsort(found.depth[at])
    return found.depth[at][order], found.kind[at][order].tolist()


@pytest.mark.parametrize(
    ("cubes", "depth", "kinds"),
    [
        ([(1, -3)], [2.5, 3.5], [1, -1]),
        ([(1, -3), (1, -3.5)], [2.5, 4.0], [1, -1]),  # they overlap
        ([(1, -3), (1, -4)], [2.5, 4.5], [1, -1]),  # they touch
        ([(1, -3), (1.5, -4.25 - 1e-7)], [2.5, 5.0], [1, -1]),  # but for rounding
        ([(2, -4), (1, -4)], [3.0, 5.0], [1, -1]),  # one is inside the other
        ([(1, -3), (1, -5)], [2.5, 3.5, 4.5, 5.5], [1, -1, 1, -1]),
    ],
)
def test_parts_are_one_solid(cubes, depth, kinds):
    corners = np.concatenate([cube(side, [0.07, 0.05, z]) for side, z in cubes])
    found, kind = along_the_axis(corners)
    np.testing.assert_allclose(found, depth, rtol=1e-7)
    assert kind == kinds


def test_the_edge_between_two_triangles_is_crossed_once():
    """The axis passes the diagonals of front and back, or edges along x, or corners."""
    assert along_the_axis(cube(1, [0, 0, -3]))[1] == [1, -1]
    half = np.sqrt(0.5)
    turn = np.array([[1, 0, 0], [0, half, half], [0, -half, half]])
    assert along_the_axis(cube(1, 0) @ turn + [0, 0, -3])[1] == [1, -1]
    corners = unit_shape("octahedron").triangles - np.array([0, 0, 3])
    assert along_the_axis(corners)[1] == [1, -1]


def test_open_parts_have_no_inside():
    whole, lid = cube(1, [0.07, 0.05, -5]), cube(1, [0.07, 0.05, -3])[:-1]
    depth, kind = along_the_axis(np.concatenate([whole, lid]))
    assert kind[-2:] == [1, -1]
    assert set(kind[:-2]) == {OPEN}
    np.testing.assert_allclose(depth[-2:], [4.5, 5.5])


def test_a_mesh_may_reach_behind_the_camera():
    depth, kind = along_the_axis(cube(2, [0.07, 0.05, -0.5]))
    np.testing.assert_allclose(depth, [1.5])
    assert kind == [LEAVES]


def layers_by_hand(*along):
    arrays = [np.array(x, kind).reshape(1, 1, -1) for x, kind in zip(
        zip(*along, *[(NAN, -1, 0)] * (16 - len(along)), strict=True),
        (np.float32, np.int8, np.int8), strict=True)]  # fmt: skip
    return Layers(*arrays, np.array([1, 1, 0], np.uint8))


@pytest.mark.parametrize(
    ("along", "first", "expected"),
    [
        ([(2, 1, 1), (3, 1, -1), (4, 0, 0)], (2.001, 1), [(2.001, 1, 1), (3, 1, -1), (4, 0, 0)]),
        ([(2, 1, 1), (2.1, 1, -1), (4, 0, 0)], (4, 0), [(4, 0, 0)]),
        ([(2, 1, 1), (3, 2, 1), (3.5, 2, -1), (4, 1, -1)], (3, 2), [(3, 2, 1), (3.5, 2, -1)]),
        ([(4, 0, 0)], (3, 1), [(3, 1, 1), (3, 1, -1), (4, 0, 0)]),
        ([(4, 0, 0)], (3, 3), [(3, 3, 0), (4, 0, 0)]),  # an open object
        ([(2, 1, 1), (2.1, 1, -1)], (NAN, -1), []),
    ],
)
def test_the_first_layer_is_what_single_precision_found(along, first, expected):
    layers = layers_by_hand(*along)
    depth, number = first
    _begin_with(layers, np.array([[depth]], np.float32), np.array([[number]], np.int8))
    for name, values in vars(layers_by_hand(*expected)).items():
        np.testing.assert_array_equal(getattr(layers, name), values)

"""Proofs about views: how far apart they are, and that images show what the file says.

No code is shared with the generator: rotations are found by a search, and rays are cast in NumPy.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.congruence import cube_codes, cube_rotations
from iqtt.audit.proofs.shapes import Shapes
from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.table import AuditTable
from iqtt.files.reader import QuestionsFile
from iqtt.questions.specs import SplitSpec
from scenegen.camera import pixel_directions
from scenegen.rendering.ground_truth import decode_image
from scenegen.rendering.shading import shade

Array = NDArray[Any]
ORTHONORMAL = 1e-6  # tolerance of a rotation times its transpose
STORED_DEGREES = 1e-3  # tolerance of a stored angle
LEAST_DEGREES = 1e-6  # how far rounding may take an angle below the smallest allowed one
GRAZING = 1e-3  # cube edges; rays that pass an edge at this distance may see either side
FACE_STEPS = 8  # of 255: least difference of the colours of two directions of faces
RADIANCE = {"uint8": 0.51 / 255, "float16": 1e-3, "float32": 1e-4}  # tolerance of a pixel


def rotations(tables: Sequence[AuditTable]) -> Proof:
    """Prove that each stored matrix is a rotation: orthonormal and proper."""
    wrong = []
    for table in tables:
        matrices = table.truth["world_from_shape"]
        off = np.abs(matrices @ matrices.swapaxes(2, 3) - np.eye(3)).max(axis=(2, 3))
        good = (off < ORTHONORMAL) & (np.linalg.det(matrices) > 0)
        wrong.append(~good.all(axis=1))
    rule = "orthonormal and proper"
    return judge("rotations", rule, tables, wrong, lambda t, row: "not a rotation matrix")


def angles(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that right answers are turned far enough from the reference, and as far as stored."""
    least = [table.spec.min_angle_degrees if table.spec else 0.0 for table in tables]
    turned = [_right_apart(table, s)[0] for table, s in zip(tables, shapes, strict=True)]
    wrong = []
    for table, s, angle, low in zip(tables, shapes, turned, least, strict=True):
        as_stored = np.abs(angle - table.truth["angle_degrees"]) <= STORED_DEGREES
        wrong.append((s.place >= 0) & ~(as_stored & (angle >= low - LEAST_DEGREES)))
    return judge(
        "angles",
        f"correct options rotated by at least {max(least):g} degrees, as stored",
        tables,
        wrong,
        lambda t, row: (
            f"rotated by {turned[t][row]:.4f} degrees,"
            f" {tables[t].truth['angle_degrees'][row]:.4f} stored"
        ),
    )


def lines_of_sight(tables: Sequence[AuditTable], shapes: Sequence[Shapes]) -> Proof:
    """Prove that right answers are seen from far enough beside the reference's line of sight.

    A line of sight is an axis in the frame of the shape, as the view from behind has the same
    outline, flipped. Released files have no such rule.
    """
    least = [
        table.spec.min_sight_angle_degrees if table.spec is not None else 0.0 for table in tables
    ]
    if not any(least):
        return Proof("lines of sight", "skipped", "no minimum angle is specified")
    sights = [_right_apart(table, s)[1] for table, s in zip(tables, shapes, strict=True)]
    return judge(
        "lines of sight",
        f"viewing directions of reference and correct option are at least {max(least):g} degrees"
        " apart; opposite directions count as equal",
        tables,
        [
            (s.place >= 0) & ~(angle >= low - LEAST_DEGREES)
            for s, angle, low in zip(shapes, sights, least, strict=True)
        ],
        lambda t, row: f"{sights[t][row]:.4f} degrees apart",
    )


def _right_apart(table: AuditTable, shapes: Shapes) -> Array:
    """Return `views_apart` of the reference and the right answer."""
    return views_apart(
        table, shapes, np.zeros(len(table), np.int64), 1 + shapes.place, shapes.place >= 0
    )


def views_apart(
    table: AuditTable, shapes: Shapes, first: Array, second: Array, chosen: Array
) -> Array:
    """Return how far apart one shape is seen in two images of each question, degrees, (2, Q).

    First the smallest rotation from one view to the other, then the smallest angle between their
    lines of sight, as axes. Both are infinite where they show two shapes, and unless `chosen`.

    Args:
        first, second: the images, (Q,).
        chosen: which questions to look at, (Q,) bool.
    """
    result = np.full((2, len(table)), np.inf)
    chosen = chosen & shapes.whole
    views = table.truth["world_from_shape"]
    for n in np.unique(shapes.count[chosen]).tolist():
        rows = np.flatnonzero(chosen & (shapes.count == n))
        a, b = first[rows], second[rows]
        one, target = (table.cubes[rows, image, :n].astype(np.int64) for image in (a, b))
        target = cube_codes(target)
        for turn in cube_rotations():
            # Where this turn takes the cubes of the first to those of the second, the rotation
            # between the views is: back by the first's own, this turn, the second's own. It leaves
            # the camera's axis, which is z, where it is if both see the shape along a line.
            fits = (cube_codes(one @ turn.T) == target).all(axis=1)
            fitting = rows[fits]
            between = views[fitting, b[fits]] @ turn @ views[fitting, a[fits]].swapaxes(1, 2)
            far = np.linalg.norm(between - np.eye(3), axis=(1, 2)) / (2 * math.sqrt(2))
            angle = 2 * np.arcsin(np.minimum(far, 1))
            sight = np.arccos(np.minimum(np.abs(between[:, 2, 2]), 1))
            result[:, fitting] = np.fmin(result[:, fitting], np.degrees([angle, sight]))
    return result


def cast_again(
    tables: Sequence[AuditTable], shapes: Sequence[Shapes], sample: Sequence[Array]
) -> Proof:
    """Prove that images are what rays cast at the stored cubes under the stored lights see.

    And that faces of different directions are told apart in each of them, by FACE_STEPS of 255 in
    one channel at least.

    Args:
        sample: for each table the rows to look at, in rising order.
    """
    problems: list[dict[int, str]] = []
    for table, its_shapes, rows in zip(tables, shapes, sample, strict=True):
        problems.append({})
        for row in rows[its_shapes.whole[rows]].tolist():
            problem = _difference(table.questions, row, int(its_shapes.count[row]))
            if problem:
                problems[-1][row] = problem
    return judge(
        "ray-cast images",
        "images and visible pixels equal a second rendering of the stored cubes and lights; colours"
        f" of face directions differ by at least {FACE_STEPS} of 255",
        tables,
        [np.isin(np.arange(len(t)), list(p)) for t, p in zip(tables, problems, strict=True)],
        lambda t, row: problems[t][row],
        sum(map(len, sample)),
    )


def _difference(questions: QuestionsFile, row: int, count: int) -> str:
    """Return how a question's images differ from its shapes and lights; "" if they do not."""
    spec: Any = questions.spec
    if spec is None:
        return ""
    names = ("questions", "cubes", "world_from_shape", "visible_pixels", "camera_distance")
    images, cubes, views, visible, distance = (questions.read(name, row) for name in names)
    lamps = ("light_count", "light_position", "light_color")
    lights, light_position, light_color = (questions.read(name, row) for name in lamps)
    for k in range(len(images)):
        used = slice(0, int(lights[k]))
        lamps_used = light_position[k, used], light_color[k, used]
        hit, face, radiance, sure = _first_hits(
            spec, distance, cubes[k, :count], views[k], *lamps_used
        )
        shown = np.bincount(hit[hit >= 0], minlength=count)
        unsure = np.count_nonzero(~sure)
        if np.abs(shown - visible[k, :count]).max() > unsure:
            return f"image {k} shows {shown.tolist()} pixels of its cubes, not {visible[k, :count]}"
        expected = np.clip(radiance, 0, 1)
        off = np.abs(decode_image(images[k]).clip(0, 1) - expected).max(axis=2)
        wrong = np.count_nonzero(sure & ~(off <= RADIANCE[questions.image_dtype]))
        if wrong:
            return f"image {k} has {wrong} pixels of other colours"
        apart = 255 * _least_difference(expected[hit >= 0], face[hit >= 0])
        if apart < FACE_STEPS - 1e-3:
            return f"image {k} has directions of faces whose colours differ by {apart:.1f} of 255"
    return ""


def _least_difference(color: Array, label: Array) -> float:
    """Return how far the colours (N, 3) of any two labels (N,) lie apart, in the best channel."""
    groups = [color[label == value] for value in np.unique(label)]
    gaps = [
        np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0)).max()
        for a, b in itertools.combinations(groups, 2)
    ]
    return float(min(gaps, default=np.inf))


def _first_hits(
    spec: SplitSpec,
    distance: float,
    cubes: Array,
    view: Array,
    light_position: Array,
    light_color: Array,
) -> tuple[Array, Array, Array, Array]:
    """Cast a ray through the middle of each pixel.

    Args:
        distance: from the camera to the origin, cube edges.
        cubes: integer coordinates, (n, 3).
        view: rotation world_from_shape, (3, 3).
        light_position, light_color: (L, 3) each.

    Returns which cube each ray sees, -1 for none, (H, W); which way the face that it meets points,
    0 to 5, (H, W); the radiance, (H, W, 3); and whether no edge is so near that rounding may
    decide, (H, W).
    """
    height, width = spec.height, spec.width
    world_from_camera = spec.camera(distance).world_from_camera
    rays = pixel_directions(height, width, spec.fov_y_degrees).reshape(-1, 3)
    rays = rays @ world_from_camera[:3, :3].T @ view  # from here on, all is in the shape's frame
    eye = world_from_camera[:3, 3] @ view
    low = cubes - (cubes.min(axis=0) + cubes.max(axis=0) + 1) / 2
    a, b = ((low + corner - eye) / rays[:, None] for corner in (0, 1))
    enter, leave = np.minimum(a, b), np.maximum(a, b)
    first, last = enter.max(axis=2), leave.min(axis=2)
    depth = np.where(first <= last, first, np.inf)
    cube = depth.argmin(axis=1)
    every = np.arange(len(rays))
    nearest = depth[every, cube]
    hit = np.isfinite(nearest)
    # A ray is unsure if it grazes an edge of a cube in front, or if two cubes or faces are as near.
    clear = GRAZING / distance
    close = (np.abs(last - first) < GRAZING) & (
        np.minimum(first, last) < nearest[:, None] + GRAZING
    )
    sure = ~close.any(axis=1)
    sure &= np.count_nonzero(depth < nearest[:, None] + clear, axis=1) <= 1
    faces = enter[every, cube]
    sure &= ~hit | (np.count_nonzero(faces > nearest[:, None] - clear, axis=1) <= 1)
    axis = faces.argmax(axis=1)
    normals = -np.sign(rays[every, axis])[:, None] * np.eye(3)[axis]
    points = eye + np.where(hit, nearest, 0)[:, None] * rays
    radiance = shade(
        points,
        normals,
        np.array(spec.reflectance),
        light_position @ view,
        light_color,
        np.array(spec.ambient),
        np.array((0.0, 1.0)),
    )
    radiance[~hit] = spec.background
    return (
        np.where(hit, cube, -1).reshape(height, width),
        (2 * axis + (rays[every, axis] > 0)).reshape(height, width),
        radiance.reshape(height, width, 3),
        sure.reshape(height, width),
    )

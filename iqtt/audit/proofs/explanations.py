"""No wrong answer explains the reference: drawn in its place, it would give another picture.

A wrong answer could be defended if its shape, turned and put where the reference is, looked the
same and differed only in cubes that do not show. The rule of the task rules that out: every cube
shows at least `min_cube_pixels` pixels in every picture. Here that is tried, not assumed: each
wrong answer is laid on the reference in all 24 turns and all shifts under which at most MOVED cubes
do not coincide, and rays are cast at the cubes that do not. Two pictures count as the same where
fewer than `min_cube_pixels` pixels show another face direction, or background instead of a face.
Depth is not compared, as a picture hardly shows it, so more counts as the same than does to the
eye. More than MOVED cubes elsewhere are not tried: all of them would have to leave the picture as
it is, and yet to show.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.audit.congruence import cube_codes, cube_rotations
from iqtt.audit.proofs.shapes import Shapes
from iqtt.audit.proofs.verdict import Proof, judge
from iqtt.audit.table import AuditTable
from iqtt.questions.specs import SplitSpec
from scenegen.camera import pixel_directions

Array = NDArray[Any]
MOVED = 3  # cubes of a wrong answer that may lie elsewhere than the reference's
GRID = 12  # rays a side at each cube that does not coincide, for a rough count
ROUGH = 4  # where the rough count is below so many times the limit, pixels are counted
REACH = 0.87  # half the side of the square of rays, cube edges: no cube reaches farther
_QUESTIONS, _CANDIDATES = 64, 64  # at a time: bounds the memory


def no_other_explanation(
    tables: Sequence[AuditTable], shapes: Sequence[Shapes], sample: Sequence[Array]
) -> Proof:
    """Prove that no wrong answer, laid on the reference, gives its picture and shows all its cubes.

    Args:
        sample: for each table the rows to look at, in rising order.
    """
    wrong, tried, hiding = [], 0, 0
    for table, its_shapes, rows in zip(tables, shapes, sample, strict=True):
        explained = np.zeros(len(table), np.bool_)
        if table.spec is not None:
            for n in np.unique(its_shapes.count[rows[its_shapes.whole[rows]]]).tolist():
                chosen = rows[its_shapes.whole[rows] & (its_shapes.count[rows] == n)]
                question, cubes = _laid_on(table, its_shapes, chosen, n)
                alike, shown = _looks_alike(table, question, cubes, n)
                explained[question[alike & shown]] = True
                tried += len(question)
                hiding += len(np.unique(question[alike & ~shown]))
        wrong.append(explained)
    note = f"; {hiding:,} match with hidden cubes" if hiding else ""
    return judge(
        "unique solution",
        "no distractor can be rotated to give the image of the reference with all cubes visible"
        f" ({tried:,} rotations tested{note})",
        tables,
        wrong,
        lambda t, row: "a distractor looks like the reference",
        sum(map(len, sample)),
    )


def _laid_on(table: AuditTable, shapes: Shapes, rows: Array, n: int) -> tuple[Array, Array]:
    """Return the wrong answers' shapes laid on the references.

    Returns the question of each, (M,), and its cubes in the reference's frame, (M, n, 3).
    """
    questions, laid = [np.zeros(0, np.int64)], [np.zeros((0, n, 3), np.int64)]
    for start in range(0, len(rows), _QUESTIONS):
        part = rows[start : start + _QUESTIONS]
        wrong_row, wrong = np.nonzero(~shapes.right[part])
        row = part[wrong_row]
        reference = table.cubes[row, 0, :n].astype(np.int64)
        answer = table.cubes[row, 1 + wrong, :n].astype(np.int64)
        turned = answer[:, None] @ cube_rotations().astype(np.int64).swapaxes(1, 2)
        # All shifts that take a cube to a cube; one that does so often has a large overlap.
        shift = reference[:, None, :, None] - turned[:, :, None]
        code = ((shift + 64) @ np.array([1 << 16, 1 << 8, 1])).reshape(len(row), 24, n * n)
        code.sort(axis=2)
        least = max(n - MOVED, 1)
        often = code[:, :, least - 1 :] == code[:, :, : n * n - least + 1]
        which, turn, at = np.nonzero(often)
        chosen = np.unique(np.stack([which, turn, code[which, turn, at]], axis=1), axis=0)
        which, turn, packed = chosen.T
        back = np.stack([packed >> 16, packed >> 8 & 255, packed & 255], axis=1) - 64
        cubes = turned[which, turn] + back[:, None]
        questions.append(row[which])
        laid.append(cubes)
    question, cubes = np.concatenate(questions), np.concatenate(laid)
    if not len(question):
        return question, cubes
    # The two wrong answers may give the same cubes, and so may two turns of one.
    low = cubes.min(axis=1)
    keys = np.column_stack([question, low, cube_codes(cubes)])
    _, first = np.unique(keys, axis=0, return_index=True)
    return question[first], cubes[first]


def _looks_alike(table: AuditTable, question: Array, cubes: Array, n: int) -> tuple[Array, Array]:
    """Return which candidates give the reference's picture, and which show all cubes, (M,) each."""
    spec, verdict = table.spec, np.zeros((2, len(question)), np.bool_)
    if spec is None:
        return verdict[0], verdict[1]
    for start in range(0, len(question), _CANDIDATES):
        row, candidate = (values[start : start + _CANDIDATES] for values in (question, cubes))
        reference = table.cubes[row, 0, :n].astype(np.int64)
        eye, axes = _camera(table, row)
        centre = (reference.min(axis=1) + reference.max(axis=1) + 1) / 2
        shown, other = (
            (c + 0.5 - centre[:, None]).astype(np.float32) for c in (reference, candidate)
        )
        differing = np.maximum(
            _pixels_apart(shown, other, eye, axes, spec),
            _pixels_apart(other, shown, eye, axes, spec),
        )
        for k in np.flatnonzero(differing < ROUGH * spec.min_cube_pixels).tolist():
            rays = (_pixel_rays(spec) @ axes[k])[None].astype(np.float32)
            _, face = _first_hits(shown[k : k + 1], eye[k : k + 1], rays)
            cube, other_face = _first_hits(other[k : k + 1], eye[k : k + 1], rays)
            least = np.bincount(cube[cube >= 0], minlength=n).min()
            verdict[0, start + k] = np.count_nonzero(face != other_face) < spec.min_cube_pixels
            verdict[1, start + k] = least >= spec.min_cube_pixels
    return verdict[0], verdict[1]


def _pixels_apart(shape: Array, other: Array, eye: Array, axes: Array, spec: SplitSpec) -> Array:
    """Return roughly how many pixels of cubes that the other shape lacks it shows in another way.

    Args:
        shape, other: centres of the cubes of two shapes in one frame, (M, n, 3).
        eye, axes: as `_camera` gives them.

    Returns (M,) pixels, of which a ray of the grid stands for several.
    """
    step = ((np.arange(GRID) + 0.5) / GRID * 2 - 1) * REACH
    s, t = (v.reshape(-1, 1) for v in np.meshgrid(step, step))
    square = (s * axes[:, None, 0] + t * axes[:, None, 1]).astype(np.float32)
    result = np.zeros(len(shape))
    focal = min(spec.height, spec.width) / 2 / math.tan(math.radians(spec.fov_degrees) / 2)
    lacks = (np.abs(shape[:, :, None] - other[:, None]) > 0.5).any(axis=3).all(axis=2)
    for i in range(shape.shape[1]):
        lacking = np.flatnonzero(lacks[:, i])
        rays = shape[lacking, i, None] + square[lacking] - eye[lacking, None]
        cube, face = _first_hits(shape[lacking], eye[lacking], rays)
        _, other_face = _first_hits(other[lacking], eye[lacking], rays)
        depth = -((shape[lacking, i] - eye[lacking]) * axes[lacking, 2]).sum(axis=1)
        pixels = (2 * REACH / GRID * focal / depth) ** 2
        result[lacking] += np.count_nonzero((cube == i) & (face != other_face), axis=1) * pixels
    return result


def _camera(table: AuditTable, row: Array) -> tuple[Array, Array]:
    """Return the eye, (M, 3), and the camera's three axes, (M, 3, 3), in the references' frames."""
    view = table.truth["world_from_shape"][row, 0]
    distance = table.truth["camera_distance"][row]
    eye = distance[:, None] * view[:, 2]  # the camera lies on the world's +z axis
    return eye.astype(np.float32), view


def _pixel_rays(spec: SplitSpec) -> Array:
    """Return the ray of each pixel in the axes of the camera, x right, y up, z back, (H W, 3)."""
    rays = pixel_directions(spec.height, spec.width, spec.fov_y_degrees).reshape(-1, 3)
    return np.asarray(rays @ spec.camera(1.0).world_from_camera[:3, :3].T)


def _first_hits(cubes: Array, eye: Array, rays: Array) -> tuple[Array, Array]:
    """Return the cube that each ray sees, (M, P), and its face's direction, 0 to 5; -1 for none.

    Args:
        cubes: centres, (M, n, 3).
        eye, rays: where rays begin, (M, 3), and where they go, (M, P, 3).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / rays[:, :, None]
        to_middle = (cubes - eye[:, None])[:, None] * inverse
        half = np.abs(inverse) / 2
        enter = to_middle - half
        first, last = enter.max(axis=3), (to_middle + half).min(axis=3)
        depth = np.where(first < last, first, np.inf)
    cube = depth.argmin(axis=2)
    nearest = np.take_along_axis(depth, cube[..., None], axis=2)[..., 0]
    faces = np.take_along_axis(enter, cube[..., None, None], axis=2)[:, :, 0]
    axis = faces.argmax(axis=2)
    sign = np.take_along_axis(rays, axis[..., None], axis=2)[..., 0] > 0
    hit = np.isfinite(nearest)
    return np.where(hit, cube, -1), np.where(hit, 2 * axis + sign, -1)

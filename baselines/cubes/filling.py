"""Cubes that show a picture: rays through the lattice of a pose, annealing, a finer pose."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]
SIDE = 10  # cells of the lattice along each axis
MOST = 30  # cells that a ray crosses
MARGIN = 0.1  # of the height, about the silhouette: rays there deny cells


def shown_pixels(labels: Array, half: float, step: int) -> Array:
    """Return x, y (at depth 1) and label of every step-th pixel about the silhouette, (P, 3).

    Args:
        labels: face labels, (H, W); some are not 0.
        half: tangent of half the vertical field of view.
    """
    height, width = labels.shape
    rows, columns = (np.flatnonzero(labels.any(axis=a)) for a in (1, 0))
    margin = round(MARGIN * height)
    start = step // 2
    inside = [
        at[(at >= shown[0] - margin) & (at <= shown[-1] + margin)]
        for at, shown in (
            (np.arange(start, height, step), rows),
            (np.arange(start, width, step), columns),
        )
    ]
    i, j = (grid.ravel() for grid in np.meshgrid(*inside, indexing="ij"))
    x, y = (2 * j + 1 - width) / height * half, -(2 * i + 1 - height) / height * half
    return np.stack([x, y, labels[i, j]], axis=1)


@njit(cache=True)
def _view(pose: Array, distance: float, low: Array) -> Array:
    """Return the rows of a pose and the camera's place in the lattice, (4, 3)."""
    view = np.empty((4, 3))
    view[:3] = pose
    view[3] = pose[2] * distance - low
    return view


@njit(cache=True)
def _trace(
    view: Array,
    box: Array,
    filled: Array,
    x: float,
    y: float,
    work: Array,
    cells: Array,
    faces: Array,
) -> int:
    """Fill in the cells of a box that a ray crosses, in order, up to the first filled one, and the
    label of the face it enters by; 4 where that face points away from the pose's normal, and where
    the camera is in the cell.

    Returns their number. `work` is (6, 3).
    """
    near, far = 0.0, 1e9
    axis = -1
    for a in range(3):
        ray = view[0, a] * x + view[1, a] * y - view[2, a]
        if abs(ray) < 1e-9:
            ray = 1e-9
        inverse = 1 / ray
        s, t = (box[0, a] - view[3, a]) * inverse, (box[1, a] - view[3, a]) * inverse
        if ray < 0:
            s, t = t, s
        if s > near:
            near, axis = s, a
        far = min(far, t)
        work[0, a], work[1, a] = ray, inverse
    if near >= far:
        return 0
    place = 0
    for a in range(3):
        ray, inverse = work[0, a], work[1, a]
        cell = np.floor(view[3, a] + near * ray)
        if a == axis:
            cell = box[0, a] if ray > 0 else box[1, a] - 1
        cell = min(box[1, a] - 1, max(box[0, a], cell))
        work[2, a] = (cell + (ray > 0) - view[3, a]) * inverse  # where it leaves the cell
        work[3, a] = abs(inverse)
        stride = SIDE * SIDE if a == 0 else (SIDE if a == 1 else 1)
        place += int(cell) * stride
        work[4, a] = stride if ray > 0 else -stride
        work[5, a] = box[1, a] - 1 - cell if ray > 0 else cell - box[0, a]  # cells to come
    for count in range(MOST):
        cells[count] = place
        faces[count] = axis + 1 if axis >= 0 and work[0, axis] < 0 else 4
        if filled[place]:
            return count + 1
        axis = 0
        if work[2, 1] < work[2, axis]:
            axis = 1
        if work[2, 2] < work[2, axis]:
            axis = 2
        if work[5, axis] == 0:
            return count + 1
        work[5, axis] -= 1
        place += int(work[4, axis])
        work[2, axis] += work[3, axis]
    return MOST


@njit(cache=True)
def _box(filled: Array) -> Array:
    """Return the lowest filled cell along each axis and one above the highest, (2, 3)."""
    box = np.zeros((2, 3))
    box[0] = SIDE
    for c in np.flatnonzero(filled):
        for a, v in enumerate((c // SIDE**2, c // SIDE % SIDE, c % SIDE)):
            box[0, a], box[1, a] = min(box[0, a], v), max(box[1, a], v + 1)
    return box


@njit(cache=True)
def misfit(
    pose: Array, distance: float, low: Array, filled: Array, pixels: Array, most: float = np.inf
) -> float:
    """Return mismatched pixels over those that the picture shows; infinity where that is more than
    `most`.
    """
    view, box = _view(pose, distance, low), _box(filled)
    cells, faces, work = np.empty(MOST, np.int16), np.empty(MOST, np.int8), np.empty((6, 3))
    shown = max(1, int(np.count_nonzero(pixels[:, 2])))
    wrong = 0.0
    for x, y, label in pixels:
        count = _trace(view, box, filled, x, y, work, cells, faces)
        seen = faces[count - 1] if count and filled[cells[count - 1]] else 0
        if seen != label:
            wrong += 0.5 if seen == 4 and label else 1.0
            if wrong > most * shown:
                return np.inf
    return wrong / shown


@njit(cache=True)
def pixel_counts(pose: Array, distance: float, low: Array, filled: Array, pixels: Array) -> Array:
    """Return how many of the pixels show each filled cell, (SIDE**3,) integers."""
    view, box = _view(pose, distance, low), _box(filled)
    cells, faces, work = np.empty(MOST, np.int16), np.empty(MOST, np.int8), np.empty((6, 3))
    counts = np.zeros(SIDE**3, np.int64)
    for x, y, _ in pixels:
        count = _trace(view, box, filled, x, y, work, cells, faces)
        if count and filled[cells[count - 1]]:
            counts[cells[count - 1]] += 1
    return counts


@njit(cache=True)
def _rays(pose: Array, distance: float, low: Array, pixels: Array) -> Any:
    """Return the cells and faces of each pixel's ray, and how many; and for each cell how many rays
    cross it, and how many of them show the background.
    """
    cells, faces = np.empty((len(pixels), MOST), np.int16), np.empty((len(pixels), MOST), np.int8)
    counts = np.empty(len(pixels), np.int64)
    view, box, work = _view(pose, distance, low), np.zeros((2, 3)), np.empty((6, 3))
    box[1] = SIDE
    filled = np.zeros(SIDE**3, np.bool_)
    bare, crossed = np.zeros(SIDE**3), np.zeros(SIDE**3)
    for r in range(len(pixels)):
        x, y, label = pixels[r]
        counts[r] = _trace(view, box, filled, x, y, work, cells[r], faces[r])
        for k in range(counts[r]):
            crossed[cells[r, k]] += 1
            bare[cells[r, k]] += label == 0
    return cells, faces, counts, bare, crossed


@njit(cache=True)
def explained(pose: Array, distance: float, low: Array, pixels: Array) -> float:
    """Return the share of shown rays that a cell within the silhouette can explain."""
    cells, faces, counts, bare, crossed = _rays(pose, distance, low, pixels)
    seen = pixels[:, 2]
    good, shown = 0, 0
    for r in range(len(counts)):
        if seen[r] == 0:
            continue
        shown += 1
        for k in range(counts[r]):
            c = cells[r, k]
            if faces[r, k] == seen[r] and bare[c] <= 0.12 * crossed[c]:
                good += 1
                break
    return good / max(shown, 1)


@njit(cache=True)
def fill(  # noqa: PLR0912
    pose: Array,
    distance: float,
    low: Array,
    pixels: Array,
    fewest: int,
    most: int,
    moves: int,
    rng: Any,
) -> Any:
    """Return the filled cells of the least energy by annealing, (SIDE**3,) bool, and that energy.

    The energy is mismatched rays, and penalties of numbers of cubes out of bounds, of separate
    parts, and of a bounding box whose centre is not the origin.
    """
    cells, faces, counts, bare, crossed = _rays(pose, distance, low, pixels)
    seen = pixels[:, 2]
    usable = np.flatnonzero((crossed >= 2) & (bare <= 0.3 * crossed))
    filled, best = np.zeros(SIDE**3, np.bool_), np.zeros(SIDE**3, np.bool_)
    if len(usable) == 0:
        return best, 1e9
    starts = np.zeros(SIDE**3 + 1, np.int64)
    for r in range(len(counts)):
        for k in range(counts[r]):
            starts[cells[r, k] + 1] += 1
    starts = np.cumsum(starts)
    place, rays = starts.copy(), np.empty(starts[-1], np.int64)
    for r in range(len(counts)):
        for k in range(counts[r]):
            rays[place[cells[r, k]]] = r
            place[cells[r, k]] += 1
    shown = 0
    for r in range(len(seen)):
        shown += seen[r] > 0
    weight = 0.02 * shown + 2.0
    wrong = np.empty(len(seen))
    for r in range(len(seen)):
        wrong[r] = 1.0 if seen[r] else 0.0
    total = wrong.sum()
    now = total + _penalty(filled, usable, low, fewest, most) * weight
    least = now
    changed = np.empty(2, np.int64)
    for move in range(moves):
        heat = 0.012 * shown * (1 - move / moves) ** 2 + 0.05
        count = 1
        changed[0] = usable[rng.integers(0, len(usable))]
        if rng.random() < 0.6:
            changed[1] = usable[rng.integers(0, len(usable))]
            if filled[changed[0]] != filled[changed[1]]:
                count = 2
        # The energy is drawn that is still accepted; most moves are beyond it by their rays alone.
        bound = now - heat * np.log(1 - rng.random())
        for i in range(count):
            filled[changed[i]] = not filled[changed[i]]
        after = total
        for i in range(count):
            after += _update(changed[i], filled, starts, rays, cells, faces, counts, seen, wrong)
        energy = after
        if after <= bound:
            energy += _penalty(filled, usable, low, fewest, most) * weight
        if energy <= bound:
            now, total = energy, after
            if now < least:
                least = now
                best[:] = filled
        else:
            for i in range(count):
                filled[changed[i]] = not filled[changed[i]]
            for i in range(count):
                _update(changed[i], filled, starts, rays, cells, faces, counts, seen, wrong)
    return best, least / max(shown, 1)


@njit(cache=True)
def _update(
    cell: int,
    filled: Array,
    starts: Array,
    rays: Array,
    cells: Array,
    faces: Array,
    counts: Array,
    seen: Array,
    wrong: Array,
) -> float:
    change = 0.0
    for n in range(starts[cell], starts[cell + 1]):
        r = rays[n]
        face = 0
        for k in range(counts[r]):
            if filled[cells[r, k]]:
                face = faces[r, k]
                break
        error = 0.0 if face == seen[r] else (0.5 if face == 4 and seen[r] else 1.0)
        change += error - wrong[r]
        wrong[r] = error
    return change


@njit(cache=True)
def _penalty(filled: Array, usable: Array, low: Array, fewest: int, most: int) -> float:
    members = np.empty(64, np.int64)
    count = 0
    for c in usable:
        if filled[c]:
            if count == 64:
                return 1000.0
            members[count] = c
            count += 1
    cost = float(max(0, fewest - count) + max(0, count - most))
    if count == 0:
        return cost + 3
    for a in range(3):
        divisor = SIDE * SIDE if a == 0 else (SIDE if a == 1 else 1)
        first, last = SIDE, -1
        for i in range(count):
            v = members[i] // divisor % SIDE
            first, last = min(first, v), max(last, v)
        cost += abs((first + last + 1) / 2 + low[a])
    reached = np.zeros(64, np.bool_)
    stack = np.empty(64, np.int64)
    parts = 0
    for i in range(count):
        if reached[i]:
            continue
        parts += 1
        reached[i] = True
        stack[0] = i
        size = 1
        while size:
            size -= 1
            c = members[stack[size]]
            for j in range(count):
                if not reached[j]:
                    d = members[j]
                    apart = abs(c // SIDE**2 - d // SIDE**2) + abs(c % SIDE - d % SIDE)
                    apart += abs(c // SIDE % SIDE - d // SIDE % SIDE)
                    if apart == 1:
                        reached[j] = True
                        stack[size] = j
                        size += 1
    return cost + parts - 1


def refine(
    pose: Array, distance: float, low: Array, filled: Array, pixels: Array
) -> tuple[Array, float, float]:
    """Return the pose, distance and misfit after a pattern search over small turns."""
    best = misfit(pose, distance, low, filled, pixels)
    for angle in (0.02, 0.01, 0.005, 0.0025):
        for _ in range(2):
            before = best
            for axis in range(4):
                for sign in (-angle, angle):
                    turned, away = pose, distance
                    if axis == 3:
                        away = distance * (1 + sign)
                    else:
                        turned = _turn(axis, sign) @ pose
                    value = misfit(turned, away, low, filled, pixels, best)
                    if value < best:
                        pose, distance, best = turned, away, value
                        break
            if best == before:
                break
    return pose, distance, best


def _turn(axis: int, angle: float) -> Array:
    turn = np.eye(3)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn[a, a] = turn[b, b] = np.cos(angle)
    turn[a, b], turn[b, a] = -np.sin(angle), np.sin(angle)
    return turn

"""Cubes that show a picture: rays through the lattice of a pose, annealing, a finer pose."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]
SIDE = 10  # cells of the lattice along each axis
MOST = 30  # cells that a ray crosses


@njit(cache=True)
def trace(
    pose: Array, distance: float, low: Array, x: float, y: float, cells: Array, faces: Array
) -> int:
    """Fill in the cells that a ray crosses, in order, and the label of the face it enters by; 4
    where that face points away from the pose's normal. Returns their number.
    """
    origin, ray, near, far = np.empty(3), np.empty(3), -1e9, 1e9
    axis = 0
    for a in range(3):
        origin[a] = pose[2, a] * distance - low[a]
        ray[a] = pose[0, a] * x + pose[1, a] * y - pose[2, a]
        if abs(ray[a]) < 1e-9:
            ray[a] = 1e-9
        s, t = -origin[a] / ray[a], (SIDE - origin[a]) / ray[a]
        if s > t:
            s, t = t, s
        if s > near:
            near, axis = s, a
        far = min(far, t)
    if near >= far:
        return 0
    cell, step = np.empty(3, np.int64), np.empty(3, np.int64)
    following, width = np.empty(3), np.empty(3)
    for a in range(3):
        cell[a] = min(SIDE - 1, max(0, int(np.floor(origin[a] + near * ray[a]))))
        step[a] = 1 if ray[a] > 0 else -1
        if a == axis:
            cell[a] = 0 if ray[a] > 0 else SIDE - 1
        following[a] = (cell[a] + (ray[a] > 0) - origin[a]) / ray[a]
        width[a] = 1 / abs(ray[a])
    count = 0
    while count < MOST:
        cells[count] = (cell[0] * SIDE + cell[1]) * SIDE + cell[2]
        faces[count] = axis + 1 if ray[axis] < 0 else 4
        count += 1
        axis = 0
        if following[1] < following[axis]:
            axis = 1
        if following[2] < following[axis]:
            axis = 2
        cell[axis] += step[axis]
        if cell[axis] < 0 or cell[axis] >= SIDE:
            break
        following[axis] += width[axis]
    return count


@njit(cache=True)
def misfit(
    pose: Array, distance: float, low: Array, filled: Array, labels: Array, half: float, step: int
) -> float:
    """Return mismatched pixels, of every step-th, over those that the picture shows."""
    height, width = labels.shape
    cells, faces = np.empty(MOST, np.int64), np.empty(MOST, np.int64)
    wrong, shown = 0.0, 0
    for i in range(step // 2, height, step):
        for j in range(step // 2, width, step):
            x, y = (2 * j + 1 - width) / height * half, -(2 * i + 1 - height) / height * half
            seen = 0
            for k in range(trace(pose, distance, low, x, y, cells, faces)):
                if filled[cells[k]]:
                    seen = faces[k]
                    break
            shown += labels[i, j] > 0
            if seen != labels[i, j]:
                wrong += 0.5 if seen == 4 and labels[i, j] else 1.0
    return wrong / max(shown, 1)


@njit(cache=True)
def shown_cells(
    pose: Array, distance: float, low: Array, filled: Array, labels: Array, half: float
) -> Array:
    """Return which filled cells show in the picture, (SIDE**3,) bool."""
    height, width = labels.shape
    cells, faces = np.empty(MOST, np.int64), np.empty(MOST, np.int64)
    shown = np.zeros(SIDE**3, np.bool_)
    for i in range(height):
        for j in range(width):
            x, y = (2 * j + 1 - width) / height * half, -(2 * i + 1 - height) / height * half
            for k in range(trace(pose, distance, low, x, y, cells, faces)):
                if filled[cells[k]]:
                    shown[cells[k]] = True
                    break
    return shown


@njit(cache=True)
def _rays(pose: Array, distance: float, low: Array, labels: Array, half: float, step: int) -> Any:
    height, width = labels.shape
    rows = ((height - step // 2 + step - 1) // step) * ((width - step // 2 + step - 1) // step)
    cells, faces = np.empty((rows, MOST), np.int64), np.empty((rows, MOST), np.int64)
    counts, seen = np.empty(rows, np.int64), np.empty(rows, np.int64)
    r = 0
    for i in range(step // 2, height, step):
        for j in range(step // 2, width, step):
            x, y = (2 * j + 1 - width) / height * half, -(2 * i + 1 - height) / height * half
            counts[r] = trace(pose, distance, low, x, y, cells[r], faces[r])
            seen[r] = labels[i, j]
            r += 1
    bare, crossed = np.zeros(SIDE**3), np.zeros(SIDE**3)
    for r in range(rows):
        for k in range(counts[r]):
            crossed[cells[r, k]] += 1
            bare[cells[r, k]] += seen[r] == 0
    return cells, faces, counts, seen, bare, crossed


@njit(cache=True)
def explained(
    pose: Array, distance: float, low: Array, labels: Array, half: float, step: int
) -> float:
    """Return the share of shown rays that a cell within the silhouette can explain."""
    cells, faces, counts, seen, bare, crossed = _rays(pose, distance, low, labels, half, step)
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
    labels: Array,
    half: float,
    step: int,
    fewest: int,
    most: int,
    moves: int,
    rng: Any,
) -> Any:
    """Return the filled cells of the least energy by annealing, (SIDE**3,) bool, and that energy.

    The energy is mismatched rays, and penalties of numbers of cubes out of bounds, of separate
    parts, and of a bounding box whose centre is not the origin.
    """
    cells, faces, counts, seen, bare, crossed = _rays(pose, distance, low, labels, half, step)
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
        for i in range(count):
            filled[changed[i]] = not filled[changed[i]]
        after = total
        for i in range(count):
            after += _update(changed[i], filled, starts, rays, cells, faces, counts, seen, wrong)
        energy = after + _penalty(filled, usable, low, fewest, most) * weight
        if energy <= now or rng.random() < np.exp((now - energy) / heat):
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
    pose: Array, distance: float, low: Array, filled: Array, labels: Array, half: float, fine: int
) -> tuple[Array, float, float]:
    """Return the pose, distance and misfit after a pattern search over small turns."""
    best = misfit(pose, distance, low, filled, labels, half, fine)
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
                    value = misfit(turned, away, low, filled, labels, half, fine)
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

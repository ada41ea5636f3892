"""Scores of rooms in plain numpy, written from docs/definitions.md and not from the code.

Names and order are those of the page. Arrays of pixels are (H, W, ...), with NaN at pixels that are
not scored, or (N, ...) over the N scored pixels. Nothing here is fast.
"""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
NEIGHBOURS = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)]
DEPTH_ALIGNMENTS = "scale", "scale_shift", "scale_l1", "scale_shift_l1", "disparity_scale_shift"
ALIGNMENTS = {
    ("depth", "none"): DEPTH_ALIGNMENTS,
    ("depth", "median_scale"): ("median_scale", *DEPTH_ALIGNMENTS),
    ("depth", "scale"): DEPTH_ALIGNMENTS,
    ("depth", "scale_shift"): ("scale_shift", "scale_shift_l1"),
    ("disparity", "scale_shift"): ("disparity_scale_shift",),
}


def items(views: list[SimpleNamespace], submission: Path) -> dict[str, Array]:
    """Return every column of `items`: (rows,), with NaN where a score is missing."""
    with h5py.File(submission) as file:
        kind = next(k for k in ("depth", "disparity", "points") if k in file)
        alignment = file.attrs.get("alignment", "scale_shift" if kind == "disparity" else "none")
        order = np.argsort(file["row"][()])
        given = {name: file[name][()][order].astype(float) for name in file if name != "row"}
    others = other_rows(views)
    table = []
    for row, view in enumerate(views):
        z, P = aligned(view, kind, given[kind][row][view.mask], alignment)
        scores = geometry(view, z, P, kind)
        scores |= after_alignment(view, z, P, kind, alignment)
        if "normal" in given:
            predicted = given["normal"][row][view.mask]
            inside = view.inside > 0
            angles = angle(predicted, view.n)
            scores |= normal_scores("normal_", angles)
            scores |= part("object_normal_mean_degrees", angles, view.counts)
            scores |= part("shape_normal_degrees", angles, inside)
        if "fov_y_degrees" in given:
            scores["fov_bias_degrees"] = given["fov_y_degrees"][row] - view.fov
            scores["fov_error_degrees"] = abs(scores["fov_bias_degrees"])
        if "confidence" in given:
            scores |= confidence(abs(z - view.t) / view.t, given["confidence"][row][view.mask])
        if others and "relief_iou" in scores:
            scores |= other_scene(view, views[others[row]], z, P, kind)
        table.append(scores | view.floors | {"row": row})
    names = {name for scores in table for name in scores}
    return {name: np.array([scores.get(name, np.nan) for scores in table]) for name in names}


# Input


def read_truth(path: Path) -> list[SimpleNamespace]:
    """Return the truth of each row, with all that follows from the truth alone."""
    with h5py.File(path) as file:
        columns = [
            file[name][()]
            for name in (
                *("depth", "normal", "object_id", "camera/world_from_camera"),
                *("camera/fov_y_degrees", "scene_index", "view_index"),
            )
        ]
    views = [view_of(*values) for values in zip(*columns, strict=True)]
    for row, view in enumerate(views):
        view.row = row
        view.turned = [true_pairs(view, q) for q in (1, 2, 4, 8)]
        same = [one for one in views if one.scene == view.scene and one.view == 0]
        view.first = same[0] if same else None
        view.hidden = hidden(view)
        view.floors = cut_outs(view) | empty_room_scores(view) | blind(view)
        view.floors |= {"scene_index": view.scene, "view_index": view.view}
        view.floors["view_angle_degrees"] = view_angle(view)
    return views


def view_of(
    depth: Array, normal: Array, ids: Array, pose: Array, fov: float, scene: int, view: int
):
    height, width = depth.shape
    v = SimpleNamespace(scene=scene, view=view, fov=fov, H=height, W=width, stored=depth)
    v.s = 2 * np.tan(np.radians(fov) / 2) / height
    r, c = np.mgrid[:height, :width]
    v.d = np.stack(
        [(c + 0.5 - width / 2) * v.s, (height / 2 - r - 0.5) * v.s, -np.ones(r.shape)], -1
    )
    v.u = v.d / length(v.d)[..., None]
    v.R, v.o = pose[:3, :3], pose[:3, 3]
    v.mask = np.isfinite(depth)
    v.pixel = np.stack([r[v.mask], c[v.mask]], -1)
    v.t, v.n = depth[v.mask].astype(float), normal[v.mask].astype(float)
    v.rays = v.d[v.mask]
    v.T = v.t[:, None] * v.rays
    ids = np.where(v.mask, ids, -1)
    v.objects = [k for k in np.unique(ids) if k > 0 and (ids == k).sum() >= 16]
    v.ids = ids[v.mask]
    v.counts = np.isin(v.ids, v.objects)
    edge = np.pad(ids, 1, constant_values=-2)
    around = [edge[1 + i : 1 + i + height, 1 + j : 1 + j + width] for i, j in NEIGHBOURS]
    inside = np.where(np.all([one == ids for one in around], axis=0), ids, 0)[v.mask]
    large = [k for k in v.objects if (inside == k).sum() >= 16]
    v.inside = np.where(np.isin(inside, large), inside, 0)  # id of the object, or 0
    v.Z = empty_room(v, v.d)
    v.derived, v.smooth = derived_normals(v, v.T)
    return v


def length(a: Array) -> Array:
    return np.sqrt((a**2).sum(-1))


def on_grid(view, values: Array) -> Array:
    grid = np.full((view.H, view.W, *values.shape[1:]), np.nan)
    grid[view.mask] = values
    return grid


def pos(x: float, y: float) -> float:
    return max(x / y, 0) if y > 0 else 0


def part(name: str, values: Array, chosen: Array) -> dict[str, float]:
    return {name: values[chosen].mean()} if chosen.any() else {}


# Aligned prediction


def aligned(view, kind: str, a: Array, alignment: str) -> tuple[Array, Array]:
    if kind == "points":
        P = align_points(a, view.T, alignment)
        return -P[:, 2], P
    z = fit(a, view.t) if kind == "disparity" else align(a, view.t, alignment)
    return z, z[:, None] * view.rays


def line(a: Array, b: Array) -> Array:
    centred = a - a.mean()
    return b.mean() + pos((centred * (b - b.mean())).sum(), (centred**2).sum()) * centred


def fit(q: Array, t: Array) -> Array:
    return 1 / np.maximum(line(q, 1 / t), (1 / t).min())


def weighted_median(v: Array, w: Array) -> float:
    order = np.argsort(v)
    total = np.cumsum(w[order])
    return v[order][np.argmax(total >= total[-1] / 2)]


def align(a: Array, t: Array, alignment: str) -> Array:
    if alignment == "median_scale":
        return pos(np.median(t), np.median(a)) * a
    if alignment == "scale":
        return pos((a * t).sum(), (a**2).sum()) * a
    if alignment == "scale_shift":
        return line(a, t)
    if alignment == "scale_l1":
        some = a != 0
        if not some.any():
            return a
        return max(weighted_median((t / np.where(some, a, 1))[some], (abs(a) / t)[some]), 0) * a
    if alignment == "scale_shift_l1":
        return least_line(a, t)
    if alignment == "disparity_scale_shift":
        return fit(1 / np.maximum(a / (abs(a).max() or 1), 1e-4), t)
    return a


def least_line(a: Array, t: Array) -> Array:
    """Return k a + b by bisection of the slope of the error in k, which is convex."""
    a, w = a - a.mean(), 1 / t

    def slope(k: float) -> float:
        v = t - k * a
        order = np.argsort(v)
        total = np.cumsum(w[order])
        m = np.argmax(total >= total[-1] / 2)
        sign = np.where(np.arange(len(v)) < m, -1.0, 1.0)
        others = np.arange(len(v)) != m
        sign[m] = -(w[order] * sign)[others].sum() / w[order[m]]  # so that no other b is better
        return -(w * a)[order] @ sign

    low, high = 0.0, 1.0
    if slope(0) < -1e-12 * (w * abs(a)).sum():
        while slope(high) < 0:
            low, high = high, 2 * high
        for _ in range(100):
            middle = (low + high) / 2
            low, high = (middle, high) if slope(middle) < 0 else (low, middle)
    else:
        high = 0.0
    return high * a + weighted_median(t - high * a, w)


def align_points(p: Array, T: Array, alignment: str) -> Array:
    if alignment == "scale":
        return pos((p * T).sum(), (p**2).sum()) * p
    if alignment == "scale_shift":
        a, b = p - p.mean(0), T - T.mean(0)
        return T.mean(0) + pos((a * b).sum(), (a**2).sum()) * a
    return p


# Scores of geometry


def geometry(view, z: Array, P: Array, kind: str) -> dict[str, float]:
    """Return the scores of depth and points, without those after another alignment."""
    scores = depth_scores(z, view.t) | boundaries(view, z) | normals(view, P)
    between_points = nearest(P, view.T)
    scores |= distances("paper_", *between_points)
    f, b = surfaces(view, P, kind, *between_points)
    scores |= surface_scores(view, f, b, z)
    departure = (z - view.t)[:, None]
    if kind == "points":
        departure = np.column_stack([departure, P[:, :2] - z[:, None] * view.rays[:, :2]])
    scores |= shape(view, departure, z, P)
    if view.hidden.sum() >= 16:
        scores["behind_depth_error"] = length(departure[view.hidden]).mean()
        scores["behind_recall_0.05"] = (b[view.hidden] < 0.05).mean()
    v, w = (view.Z[view.mask] - view.t), predicted_relief(view, z, P, kind)
    if (v > 0.05).any():
        scores |= relief("relief_", w, v)
    scores |= pairs(view, z, P, scores["boundary_f1"]) | flying(view, z)
    scores["scale_log2"] = np.log2(max(np.median(z / view.t), 2.0**-10))
    if kind == "points":
        scores["ray_error_degrees"] = angle(P, view.rays).mean()
    return scores | points(view, P)


def depth_scores(z: Array, t: Array) -> dict[str, float]:
    e, low = z - t, np.maximum(z, 0.001)
    logs = np.log(low) - np.log(np.maximum(t, 0.001))
    ahead = z > 0.001
    logs[ahead] -= logs[ahead].mean() if ahead.any() else 0
    return {
        "mse_depth": (e**2).mean(),
        "rmse": np.sqrt((e**2).mean()),
        "abs_rel": (abs(e) / t).mean(),
        "silog": 100 * np.sqrt((logs**2).mean()),
        **{f"delta_{k}": ((z < 1.25**k * t) & (t < 1.25**k * z)).mean() for k in (1, 2, 3)},
        "delta_1.03": ((z < 1.03 * t) & (t < 1.03 * z)).mean(),
        "sq_rel": (e**2 / t).mean(),
        "rmse_log": np.sqrt(((np.log(low) - np.log(t)) ** 2).mean()),
        "log10": abs(np.log10(low) - np.log10(t)).mean(),
        "irmse": np.sqrt(((1 / low - 1 / t) ** 2).mean()),
    }


def after_alignment(view, z: Array, P: Array, kind: str, declared: str) -> dict[str, float]:
    scores = {}
    names = "mse_depth", "rmse", "abs_rel", "silog", "delta_1", "delta_1.03", "delta_2", "delta_3"
    for alignment in ALIGNMENTS["depth" if kind == "points" else kind, declared]:
        again = kind == "points" or (kind == "depth" and alignment != declared)
        found = depth_scores(align(z, view.t, alignment) if again else z, view.t)
        scores |= {f"{name}_after_{alignment}": found[name] for name in names}
    fits = ("scale_shift",) if declared == "scale_shift" else ("scale", "scale_shift")
    for alignment in () if kind == "disparity" else fits:
        found = points_scores(align_points(P, view.T, alignment), view.T)
        scores |= {f"{name}_after_{alignment}": value for name, value in found.items()}
    return scores


def boundaries(view, z: Array) -> dict[str, float]:
    D = np.maximum(on_grid(view, z), 1e-6)
    E = np.maximum(on_grid(view, view.t), 1e-6)
    thresholds = np.linspace(1.05, 1.25, 10)
    weights = thresholds / thresholds.sum()
    pairs = []
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        i, j = [slice(None)] * 2, [slice(None)] * 2
        i[axis], j[axis] = (slice(None, -1), slice(1, None))[::step]
        pairs.append(((D[tuple(j)] / D[tuple(i)]).ravel(), (E[tuple(j)] / E[tuple(i)]).ravel()))
    score = recalled = total = 0.0
    for q, w in zip(thresholds, weights, strict=True):
        pred = [(a > q).sum() for a, _ in pairs]
        true = [(b.astype(float) > q).sum() for _, b in pairs]
        both = [((a > q) & (b.astype(float) > q)).sum() for a, b in pairs]
        precision = np.mean([n / max(m, 1) for n, m in zip(both, pred, strict=True)])
        recall = np.mean([n / max(m, 1) for n, m in zip(both, true, strict=True)])
        if precision + recall > 0:
            score += w * 2 * precision * recall / (precision + recall)
        if sum(true) > 0:
            recalled, total = recalled + w * sum(both) / sum(true), total + w
    return {"boundary_f1": score} | ({"boundary_recall": recalled / total} if total else {})


# Normals


def derived_normals(view, points: Array) -> tuple[Array, Array]:
    """Return the normal of each scored pixel, and where the first attempt made it."""
    padded = np.pad(on_grid(view, points), ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
    r, c = view.pixel.T + 1
    steps = np.stack([padded[r + i, c + j] - points for i, j in NEIGHBOURS], 1)
    there = np.isfinite(steps[..., 0])
    steps = np.where(there[..., None], steps, 0)
    size = abs(steps).max((1, 2))
    steps /= np.where(size > 0, size, 1)[:, None, None]
    u = view.u[view.mask]
    along = (steps * u[:, None]).sum(-1)
    near = there & (along**2 <= np.cos(np.radians(10)) ** 2 * (steps**2).sum(-1))
    first, clear_first = planes(steps, near, u)
    second, clear_second = planes(steps, there, u)
    normal = np.where(clear_second[:, None], second, -u)
    normal = np.where(clear_first[:, None], first, normal)
    away = (normal * u).sum(-1) > 0
    return np.where(away[:, None], -normal, normal), clear_first


def planes(steps: Array, chosen: Array, u: Array) -> tuple[Array, Array]:
    v = np.where(chosen[..., None], steps, 0)
    m = chosen.sum(1)[:, None] + 1
    w = v.sum(1) / m
    C = np.einsum("nki,nkj->nij", v, v) / m[..., None] - w[:, :, None] * w[:, None, :]
    values, vectors = np.linalg.eigh(C)
    l1, l2, l3 = values.T
    n = vectors[:, :, 0]
    apart = (l2 - l1) * (l3 - l1) * abs(n).max(1) > 1e-12 * l3**2
    return n, (l2 > 1e-6 * l3) & apart & (abs((n * u).sum(1)) > 1e-4)


def angle(a: Array, b: Array) -> Array:
    return np.degrees(np.arctan2(length(np.cross(a, b)), (a * b).sum(-1)))


def normal_scores(prefix: str, angles: Array) -> dict[str, float]:
    return {
        f"{prefix}mean_degrees": angles.mean(),
        f"{prefix}median_degrees": np.median(angles),
        f"{prefix}rmse_degrees": np.sqrt((angles**2).mean()),
        **{f"{prefix}within_{x}": (angles < x).mean() for x in (5, 7.5, 11.25, 22.5, 30)},
    }


def smooth_part(view, chosen: Array) -> Array:
    smooth = chosen & view.smooth
    return smooth if smooth.any() else chosen


def normals(view, P: Array) -> dict[str, float]:
    angles = angle(derived_normals(view, P)[0], view.derived)
    scores = normal_scores("derived_normal_", angles[view.smooth])
    scores |= part("derived_object_normal_mean_degrees", angles, smooth_part(view, view.counts))
    return scores | part("derived_shape_normal_degrees", angles, smooth_part(view, view.inside > 0))


# Surfaces


def surfaces(view, P: Array, kind: str, f: Array, b: Array) -> tuple[Array, Array]:
    """Return f and b, given the distances between points alone."""
    f, b = f.copy(), b.copy()
    normal = derived_normals(view, P)[0]
    index = np.full((view.H + 2, view.W + 2), -1)
    index[1:-1, 1:-1][view.mask] = np.arange(len(P))
    ahead = np.flatnonzero(P[:, 2] < 0)
    seen = view.pixel[ahead]
    if kind == "points":
        seen = np.stack(pixel_of(view, P[ahead], view.s), -1)
    for i, j in [*NEIGHBOURS, (0, 0)]:
        r, c = seen[:, 0] + i, seen[:, 1] + j
        there = (r >= 0) & (r < view.H) & (c >= 0) & (c < view.W)
        true = index[r[there].astype(int) + 1, c[there].astype(int) + 1]
        predicted, true = ahead[there][true >= 0], true[true >= 0]
        p, t = P[predicted], view.T[true]
        np.minimum.at(f, predicted, patch(t, view.n[true], p, view.s))
        np.minimum.at(b, true, patch(p, normal[predicted], t, view.s))
    return f, b


def pixel_of(view, y: Array, s: float) -> tuple[Array, Array]:
    """Return row and column in which points before a camera of this size are seen."""
    column = np.floor(y[:, 0] / (-y[:, 2] * s) + view.W / 2)
    return np.floor(view.H / 2 - y[:, 1] / (-y[:, 2] * s)), column


def nearest(P: Array, T: Array) -> tuple[Array, Array]:
    """Return the distance of each P from the nearest T, and of each T from the nearest P."""
    squared = P @ (-2 * T.T)
    squared += (T**2).sum(1)
    squared += (P**2).sum(1)[:, None]  # not exact enough near 0
    return length(P - T[squared.argmin(1)]), length(T - P[squared.argmin(0)])


def patch(p: Array, m: Array, q: Array, s: float) -> Array:
    facing = -(m * p).sum(1) / length(p)
    reach = 1.5 * s * np.maximum(-p[:, 2], 0) / np.maximum(facing, 0.3)
    off = (m * (q - p)).sum(1)
    along = np.sqrt(np.maximum(((q - p) ** 2).sum(1) - off**2, 0))
    return np.sqrt(off**2 + np.maximum(along - reach, 0) ** 2)


def distances(prefix: str, f: Array, b: Array) -> dict[str, float]:
    return {
        f"{prefix}chamfer": f.mean() + b.mean(),
        f"{prefix}hausdorff": max(f.max(), b.max()),
        f"{prefix}hausdorff_forward": f.max(),
        f"{prefix}hausdorff_reverse": b.max(),
    }


def surface_scores(view, f: Array, b: Array, z: Array) -> dict[str, float]:
    scores = distances("", f, b)
    scores["accuracy_distance"], scores["completeness_distance"] = f.mean(), b.mean()
    scores["chamfer_squared"] = (f**2).mean() + (b**2).mean()
    scores["hausdorff_95"] = max(np.percentile(f, 95), np.percentile(b, 95))
    for x in (0.01, 0.02, 0.05):
        A, B = (f < x).mean(), (b < x).mean()
        scores[f"f_score_{x}"] = 2 * A * B / (A + B) if A + B else 0
    if view.objects:
        scores |= part("object_depth_error", abs(z - view.t), view.counts)
        scores |= part("object_completeness", b, view.counts)
        means = np.array([b[view.ids == k].mean() for k in view.objects])
        scores |= {f"object_recall_{x}": (means < x).mean() for x in (0.02, 0.05)}
    return scores


# Shape inside objects


def shape(view, departure: Array, z: Array, P: Array) -> dict[str, float]:
    inside = [view.inside == k for k in view.objects if (view.inside == k).any()]
    if not inside:
        return {}
    h = [length(departure[o] - np.median(departure[o], axis=0)) for o in inside]
    scores = {
        "shape_error": np.concatenate(h).mean(),
        "shape_recall_0.02": np.mean([one.mean() < 0.02 for one in h]),
    }
    p = np.concatenate([off_plane(P[o]) for o in inside])
    q = np.concatenate([off_plane(view.T[o]) for o in inside])
    V = (q**2).mean()
    if V > 1e-5**2:
        U = max((p**2).mean(), min(0.001**2, V))
        scores["shape_correlation"] = np.clip((p * q).mean() / np.sqrt(U * V), -1, 1)
    return scores


def off_plane(P: Array) -> Array:
    x = np.column_stack([np.ones(len(P)), P[:, :2]])
    return -P[:, 2] - x @ np.linalg.lstsq(x, -P[:, 2], rcond=None)[0]


# Hidden surfaces


def hidden(view) -> Array:
    first = view.first
    if first is None or first is view:
        return np.zeros(len(view.t), bool)
    x = view.T @ view.R.T + view.o
    y = (x - first.o) @ first.R
    depth = -y[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        r, c = pixel_of(view, y, view.s)
    outside = ~((depth > 0) & (r >= 0) & (r < view.H) & (c >= 0) & (c < view.W))
    away = ((first.o - x) * (view.n @ view.R.T)).sum(1) <= 0
    F = np.where(np.isfinite(first.stored), first.stored, np.inf)
    F = np.pad(F, 1, constant_values=-np.inf)
    r, c = (np.where(outside, 0, part).astype(int) + 1 for part in (r, c))
    largest = np.max([F[r + i, c + j] for i, j in [*NEIGHBOURS, (0, 0)]], axis=0)
    covered = depth > largest.astype(np.float32) + np.float32(0.01)
    found = view.counts & (outside | away | covered)
    return found if found.sum() >= 16 else np.zeros(len(view.t), bool)


# Empty room and relief


def empty_room(view, lines: Array) -> Array:
    g = lines @ view.R.T
    meets = (g < 0) & (view.o > 0)
    depth = np.where(meets, -view.o / np.where(meets, g, 1), np.inf).min(-1)
    met = np.isfinite(depth)
    return np.where(met, depth, depth[met].max() if met.any() else 1)


def empty_room_scores(view) -> dict[str, float]:
    Z = view.Z[view.mask]
    scores = geometry(view, Z, Z[:, None] * view.rays, "depth")
    names = {"chamfer", "hausdorff", "mse_depth", "object_depth_error", "object_completeness"}
    names |= {"abs_rel", "delta_1", "points_rel", "boundary_f1", "relative_normal_degrees"}
    names |= {"behind_depth_error", "shape_error", "derived_shape_normal_degrees"}
    found = {f"empty_room_{name}": scores[name] for name in names & scores.keys()}
    # The plane that a pixel sees is that on which its world point lies.
    world = Z[:, None] * (view.rays @ view.R.T) + view.o
    facing = np.eye(3)[np.abs(world).argmin(-1)] @ view.R
    angles = angle(facing, view.n)
    return found | part("empty_room_shape_normal_degrees", angles, view.inside > 0)


def predicted_relief(view, z: Array, P: Array, kind: str) -> Array:
    Z = view.Z[view.mask].copy()
    ahead = P[:, 2] < 0
    if kind == "points" and ahead.any():
        Z[ahead] = empty_room(view, P[ahead] / -P[ahead, 2:])
    return Z - z


def relief(prefix: str, w: Array, v: Array) -> dict[str, float]:
    W, V = w - w.mean(), v - v.mean()
    var = (V**2).mean()
    U = max((W**2).mean(), min(0.001**2, var))
    correlation = np.clip((W * V).mean() / np.sqrt(U * var), -1, 1) if var > 0 else 0
    both, either = (w > 0.05) & (v > 0.05), (w > 0.05) | (v > 0.05)
    return {f"{prefix}correlation": correlation, f"{prefix}iou": both.sum() / either.sum()}


def other_scene(view, other, z: Array, P: Array, kind: str) -> dict[str, float]:
    w = on_grid(view, predicted_relief(view, z, P, kind))
    both = view.mask & other.mask
    v = (other.Z - other.stored)[both]
    if not both.any():
        return relief("other_scene_relief_", w[view.mask], view.Z[view.mask] - view.t)
    if not (v > 0.05).any():
        return {"other_scene_relief_correlation": 0.0, "other_scene_relief_iou": 0.0}
    return relief("other_scene_relief_", w[both], v)


def other_rows(views: list[SimpleNamespace]) -> dict[int, int]:
    """Return the other row of each row, or nothing."""
    of_view = [v.view for v in views]
    keys = [k if of_view.count(k) > 1 else -1 for k in of_view]
    others = {}
    for key in set(keys):
        group = [row for row, k in enumerate(keys) if k == key]
        group.sort(key=lambda row: views[row].scene)
        others |= dict(zip(group, group[1:] + group[:1], strict=True))
    alone = any(views[a].scene == views[b].scene for a, b in others.items())
    return {} if alone else others


# Points


def points_scores(P: Array, T: Array) -> dict[str, float]:
    error = length(P - T)
    return {
        "points_rel": (error / length(T)).mean(),
        "points_delta_1": (error < 0.25 * np.minimum(length(P), length(T))).mean(),
    }


def points(view, P: Array) -> dict[str, float]:
    scores = points_scores(P, view.T)
    ks = []
    for k in view.objects:
        T = view.T[view.ids == k]
        fitted = align_points(P[view.ids == k], T, "scale_shift")
        ks.append(length(fitted - T) / (T.max(0) - T.min(0)).max())
    if ks:
        scores["local_points_rel"] = np.mean([k.mean() for k in ks])
        scores["local_points_delta_1"] = np.mean([(k < 0.25).mean() for k in ks])
    return scores


# Pairs of pixels


def spread(count: int, axes: int, row: int) -> Array:
    roots = np.roots([1, *[0] * (axes - 1), -1, -1])
    root = roots[(abs(roots.imag) < 1e-9) & (roots.real > 0)].real[0]
    k = np.arange(row * count, (row + 1) * count)
    return np.stack([0.5 + k * root**-j for j in range(1, axes + 1)], -1) % 1


def samples(view, q: int) -> Array:
    """Return the scored pixel (r, c) nearest to the middle of each square of q pixels, or -1."""
    grid = np.full((-(-view.H // q), -(-view.W // q), 2), -1)
    for i, j in np.ndindex(grid.shape[:2]):
        r, c = np.nonzero(view.mask[q * i : q * i + q, q * j : q * j + q])
        if len(r):
            k = np.argmin((r - (q - 1) / 2) ** 2 + (c - (q - 1) / 2) ** 2)
            grid[i, j] = q * i + r[k], q * j + c[k]
    return grid


def true_pairs(view, q: int) -> tuple[Array, Array, Array]:
    """Return the corners of pairs of triangles (n, 2, 3, 2), their angles, and which are of one."""
    grid = samples(view, q)
    h, w = grid.shape[0] - 2, grid.shape[1] - 2
    u = spread(8192, 4, view.row)
    radius = min(max(32 // q, 3), max(h, w))
    a = np.floor(u[:, :2] * [h, w]).astype(int)
    b = np.floor(u[:, :2] * [h, w] + (2 * u[:, 2:] - 1) * radius).astype(int)
    ends = np.stack([a, b], 1)[((b >= 0) & (b < [h, w])).all(1)]
    corners = np.stack(
        [grid[tuple((ends + o).transpose(2, 0, 1))] for o in ([0, 0], [2, 0], [0, 2])], 2
    )
    corners = corners[(corners >= 0).all((1, 2, 3))]
    n = triangle_normals(on_grid(view, view.T), corners)
    good = np.isfinite(n).all((1, 2))
    ids = on_grid(view, view.ids)[corners[good][..., 0], corners[good][..., 1]].reshape(-1, 6)
    same = (ids > 0).all(1) & (ids.min(1) == ids.max(1))
    return corners[good], angle(n[good][:, 0], n[good][:, 1]), same


def triangle_normals(X: Array, corners: Array) -> Array:
    a, b, c = np.moveaxis(X[corners[..., 0], corners[..., 1]], 2, 0)
    sides = [v / np.maximum(length(v), 1e-300)[..., None] for v in (b - a, c - a)]
    n = np.cross(*sides)
    with np.errstate(all="ignore"):
        return np.where(length(n)[..., None] > 1e-5, n / length(n)[..., None], np.nan)


def pairs(view, z: Array, P: Array, boundary_f1: float) -> dict[str, float]:
    X, errors, ours = on_grid(view, P), [], []
    for corners, true, same in view.turned:
        n = triangle_normals(X, corners)
        e = np.where(np.isfinite(n).all((1, 2)), abs(angle(n[:, 0], n[:, 1]) - true), 180)
        errors += [e.mean()] if len(e) else []
        ours += [e[same].mean()] if same.any() else []
    scores = {"relative_normal_degrees": np.mean(ours)} if ours else {}
    u = spread(16384, 2, view.row)
    everywhere = np.floor(u * len(z)).astype(int)
    order = np.argsort(view.ids, kind="stable")
    order = order[view.ids[order] > 0]
    first = order[np.floor(u[:, 0] * len(order)).astype(int)] if len(order) else order
    own = {k: order[view.ids[order] == k] for k in set(view.ids[order])}
    within = [own[view.ids[i]] for i in first]
    second = [o[int(x * len(o))] for o, x in zip(within, u[:, 1], strict=False)]
    alone = np.stack([first, np.array(second, int)], 1)
    asked = {
        "": everywhere,
        "_between": everywhere[view.ids[everywhere[:, 0]] != view.ids[everywhere[:, 1]]],
        "_within": np.concatenate([one_object(view, everywhere), alone]),
    }
    for name, both in asked.items():
        t = view.t[both]
        p = both[t.max(1) > 1.02 * t.min(1)]
        if len(p):
            right = np.sign(z[p[:, 0]] - z[p[:, 1]]) == np.sign(view.t[p[:, 0]] - view.t[p[:, 1]])
            scores[f"ordinal_accuracy{name}"] = right.mean()
    i, j = everywhere.T
    unordered = ((z[i] < z[j]) != (view.t[i] < view.t[j])).mean()
    near = []
    for fit_z in (disparity_fit(z, view.t), line(z / abs(z).max(), view.t)):
        fitted = np.maximum(fit_z, 1e-4)
        limit = 1.25**0.125
        near.append(((fitted < limit * view.t) & (view.t < limit * fitted)).mean())
    turned = np.radians(np.mean(errors)) if errors else 0
    total = 3.65 * unordered + 0.18 * (1 - near[0]) + 0.01 * (1 - near[1])
    return scores | {"sawa_h": total + 0.2 * (1 - boundary_f1) + 1.94 * turned}


def one_object(view, p: Array) -> Array:
    a, b = view.ids[p].T
    return p[(a == b) & (a > 0)]


def disparity_fit(z: Array, t: Array) -> Array:
    q = 1 / np.maximum(z / abs(z).max(), 1e-4)
    return 1 / np.maximum(line(q, 1 / t), 1e-4)


# Flying points


def across(view) -> Array:
    """Return the true depth across the nearest occlusion edge of each scored pixel, or NaN."""
    Z, ids, found = on_grid(view, view.t), on_grid(view, view.ids), []
    steps = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if 0 < i * i + j * j <= 4]
    steps.sort(key=lambda s: (s[0] ** 2 + s[1] ** 2, (-s[0], -s[1])))
    for r, c in view.pixel:
        other = np.nan
        for i, j in steps:
            if 0 <= r + i < view.H and 0 <= c + j < view.W and view.mask[r + i, c + j]:
                near, far = sorted([Z[r, c], Z[r + i, c + j]])
                if ids[r, c] != ids[r + i, c + j] and far > 1.05 * near:
                    other = Z[r + i, c + j]
                    break
        found.append(other)
    return np.array(found)


def flying(view, z: Array) -> dict[str, float]:
    if not hasattr(view, "across"):
        view.across = across(view)
    at = np.isfinite(view.across)
    part_of_gap = (z[at] - view.t[at]) / (view.across[at] - view.t[at])
    between = (part_of_gap > 0.05) & (part_of_gap < 0.95)
    return {"flying_points": between.mean()} if at.any() else {}


def half_resolution(view) -> Array:
    """Return the true depth at half the resolution, doubled again, of the scored pixels."""
    Z, rows, columns = on_grid(view, view.t), -(-view.H // 2), -(-view.W // 2)
    sums = np.zeros((2, rows, columns))
    for r, c in view.pixel:
        sums[:, r // 2, c // 2] += Z[r, c], 1
    found = []
    for r, c in view.pixel:
        total = np.zeros(2)
        for i, a in ((r // 2, 0.75), (r // 2 + (1 if r % 2 else -1), 0.25)):
            for j, b in ((c // 2, 0.75), (c // 2 + (1 if c % 2 else -1), 0.25)):
                total += a * b * sums[:, np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]
        found.append(total[0] / total[1])
    return np.array(found)


# Confidence


def confidence(errors: Array, sure: Array) -> dict[str, float]:
    areas = [sparsified(errors, order) for order in (sure, -errors)]
    return {
        "ause_abs_rel": np.mean(areas[0] - areas[1]),
        "aurg_abs_rel": np.mean(errors.mean() - areas[0]),
        "random_order_ause_abs_rel": np.mean(errors.mean() - areas[1]),
    }


def sparsified(errors: Array, sure: Array) -> Array:
    same = {x: errors[sure == x].mean() for x in set(sure.tolist())}
    sorted_errors = np.array([same[x] for x in sorted(sure.tolist(), reverse=True)])
    counts = [(len(errors) * (20 - k) + 19) // 20 for k in range(20)]
    return np.array([sorted_errors[:n].mean() for n in counts])


# Baselines


def blind(view) -> dict[str, float]:
    """Return the scores of a constant, of depth that falls downwards, and of lifted masks."""
    scores = {}
    down = (view.pixel[:, 0] + 0.5) / view.H
    own, Z = view.ids > 0, view.Z[view.mask]
    lift = max(weighted_median((Z - view.t)[own], (1 / view.t)[own]), 0) if own.any() else 0
    guesses = {"flat": line(np.ones(len(down)), view.t), "ramp": line(2 - down, view.t)}
    for name, z in {**guesses, "lifted": np.where(own, Z - lift, Z)}.items():
        found = depth_scores(z, view.t) | points_scores(z[:, None] * view.rays, view.T)
        scores |= {f"{name}_{one}": found[one] for one in ("abs_rel", "delta_1", "points_rel")}
    half = flying(view, half_resolution(view))
    return scores | {f"half_resolution_{name}": value for name, value in half.items()}


def cut_outs(view) -> dict[str, float]:
    scores = {}
    inside = view.inside
    cut = np.where(view.ids > 0, flat(view.t, view.ids, np.median), view.t)
    scores["cut_out_boundary_f1"] = boundaries(view, cut)["boundary_f1"]
    true = [angles[same].mean() for _, angles, same in view.turned if same.any()]
    scores |= {"cut_out_relative_normal_degrees": np.mean(true)} if true else {}
    of_object = flat(view.t, inside, np.median)
    scores |= part("cut_out_shape_error", abs(view.t - of_object), inside > 0)
    angles = mean_normal_angles(view.n, inside)
    scores |= part("cut_out_shape_normal_degrees", angles, inside > 0)
    smooth = np.where(smooth_part(view, inside > 0), inside, 0)
    angles = mean_normal_angles(view.derived, smooth)
    scores |= part("cut_out_derived_shape_normal_degrees", angles, smooth > 0)
    if view.hidden.any():
        of_object = flat(view.t, np.where(view.counts, view.ids, 0), np.median)
        scores |= part("cut_out_behind_depth_error", abs(of_object - view.t), view.hidden)
        for name, entry in (("balls", ball_entry), ("blocks", block_entry)):
            entries = [entry(view, view.first, k) for k in view.first.objects]
            G = np.min([view.Z[view.mask], *entries], axis=0)
            scores |= part(f"{name}_behind_depth_error", abs(G - view.t), view.hidden)
    return scores


def flat(values: Array, ids: Array, centre: Any) -> Array:
    """Return for each pixel the centre of the values of its object; 0 elsewhere."""
    found = np.zeros_like(values)
    for k in np.unique(ids[ids > 0]):
        found[ids == k] = centre(values[ids == k], axis=0)
    return found


def mean_normal_angles(n: Array, ids: Array) -> Array:
    c = flat(n, ids, np.mean)
    size = length(c)
    cosine = (n * c).sum(1) / np.where(size > 0, size, 1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def ball_or_block(first, k: int) -> tuple[Array, float, Array]:
    """Return centre, radius, and the points of an object of the first view, in the world."""
    o = first.ids == k
    slope = first.s * np.sqrt(o.sum() / np.pi)
    g = np.median(first.t[o]) / (1 - 2 / 3 * min(slope, 1))
    centre = first.R @ (g * first.rays[o].mean(0)) + first.o
    return centre, slope * g, first.T[o] @ first.R.T + first.o


def ball_entry(view, first, k: int) -> Array:
    centre, radius, _ = ball_or_block(first, k)
    c, d = (centre - view.o) @ view.R, view.rays
    dd, dc = (d**2).sum(1), d @ c
    D = dc**2 - dd * (c @ c - radius**2)
    entry = (dc - np.sqrt(np.maximum(D, 0))) / dd
    return np.where((D > 0) & (entry > 0), entry, np.inf)


def block_entry(view, first, k: int) -> Array:
    centre, _, Q = ball_or_block(first, k)
    across = Q @ first.R[:, 0]
    half = np.pi / 8 * (across.max() - across.min())
    low = np.array([centre[0] - half, 0, centre[2] - half])
    high = np.array([centre[0] + half, Q[:, 1].max(), centre[2] + half])
    g = view.rays @ view.R.T
    g = np.where(abs(g) < 1e-12, 1e-12, g)
    ends = np.stack([(low - view.o) / g, (high - view.o) / g])
    entry, leave = ends.min(0).max(1), ends.max(0).min(1)
    return np.where((entry > 0) & (entry < leave), entry, np.inf)


def view_angle(view) -> float:
    if view.first is None:
        return np.nan
    azimuths = [np.degrees(np.arctan2(v.R[0, 2], v.R[2, 2])) for v in (view, view.first)]
    return 180 - (180 - np.round(azimuths[0] - azimuths[1])) % 360


# Means and skills


def scene_means(columns: dict[str, Array], values: Array) -> Array:
    """Return the mean of each scene that has the score."""
    there = ~np.isnan(values)
    scenes, values = columns["scene_index"][there], values[there]
    return np.array([values[scenes == scene].mean() for scene in np.unique(scenes)])


def means(columns: dict[str, Array]) -> dict[str, float]:
    return {name: scene_means(columns, values).mean() for name, values in columns.items()}


def skills(columns: dict[str, Array]) -> dict[str, float]:
    """Return the skills of a submission that was shown the scored view."""
    found = {}
    kinds = ("empty_room", "cut_out", "balls", "blocks", "other_scene", "flat", "ramp")
    kinds += ("half_resolution", "random_order", "lifted")
    for name, values in columns.items():
        higher = name in ("delta_1", "boundary_f1")
        floors = [f"{kind}_{name}" for kind in kinds if f"{kind}_{name}" in columns]
        best = max if higher else min
        floor = best(floors, key=lambda f: scene_means(columns, columns[f]).mean(), default=None)
        if floor is None:
            continue
        missing = np.isnan(values) | np.isnan(columns[floor])
        pair = (np.where(missing, np.nan, x) for x in (values, columns[floor]))
        a, b = (scene_means(columns, x).mean() for x in pair)
        if higher or floor.startswith("other_scene"):
            b = max(b, 0)
            a, b = 1 - a, 1 - b
        if b > 0:
            found[name] = 1 - a / b
    return found

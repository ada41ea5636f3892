"""Further truth, which `--with` adds to the rows of a file: made here, and checked here.

Masks of whole objects are rendered, and layers are cast. All else follows from depth, cameras,
poses and reflectance (`scenegen.derived`), and is stored so that readers need no code of ours.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import (
    Lens,
    back_project,
    pixel_directions,
    transform_points,
    transform_vectors,
)
from scenegen.derived import albedo, object_coordinates, optical_flow, seen_from
from scenegen.description.specs import Request
from scenegen.rendering.layers import layers_of
from scenegen.rendering.packing import SceneBatch

Array = NDArray[Any]
COORDINATE_TOLERANCE = 1e-5  # bounding radii
FLOW_TOLERANCE = 1e-3  # pixels
EDGE_SHARE = 1e-3  # of pixels whose visibility rounding may turn


@dataclass(frozen=True, eq=False)
class View:
    """What the truth of one image follows from; a `reader.Room` has the same attributes."""

    depth: Array
    normal: Array
    object_id: Array
    world_from_camera: Array
    lens: Lens

    @property
    def points_world(self) -> Array:
        """Surface points in the world frame, (H, W, 3)."""
        return transform_points(self.world_from_camera, back_project(self.depth, self.lens))


def further_truth(
    batch: SceneBatch, first: int, pixels: Mapping[str, Array], masks: Array | None
) -> dict[str, Array]:
    """Return what `batch.spec.truth` asks for, by column, of the V views of one scene.

    Args:
        first: number of the scene's first image in the batch.
        pixels: its depth, normal and object_id, (V, ...), and albedo where it was rendered.
        masks: as from `amodal.amodal_masks`, (V, K, H, W); needed for "amodal" only.
    """
    truth, made = batch.spec.truth, dict[str, Array]()
    images = range(first, first + len(pixels["depth"]))
    maps = zip(pixels["depth"], pixels["normal"], pixels["object_id"], strict=True)
    views = [
        View(depth, normal, ids, batch.world_from_camera[i], batch.lens(i))
        for (depth, normal, ids), i in zip(maps, images, strict=True)
    ]
    if masks is not None:
        made["object/amodal_mask"] = masks.view(np.uint8)  # no copy: they are large
        made["object/visible_fraction"] = np.stack(
            [visible_fraction(v.object_id, m) for v, m in zip(views, masks, strict=True)]
        )
    if "coordinates" in truth:
        poses = batch.world_from_object[images.start : images.stop]
        made["object_coordinates"] = np.stack(
            [coordinates(v, p) for v, p in zip(views, poses, strict=True)]
        )
    if "flow" in truth:
        pairs = [flow(v, views[(i + 1) % len(views)]) for i, v in enumerate(views)]
        made["flow"], made["flow_occluded"] = (np.stack(part) for part in zip(*pairs, strict=True))
    if "albedo" in truth and "albedo" not in pixels:
        rho = batch.reflectance[images.start : images.stop]
        made["albedo"] = np.stack(
            [albedo(v.object_id, r).astype(np.float32) for v, r in zip(views, rho, strict=True)]
        )
    if "layers" in truth:
        stored = [
            stored_layers(batch, i, v.depth, v.object_id)
            for v, i in zip(views, images, strict=True)
        ]
        made |= {name: _all_of([one[name] for one in stored]) for name in stored[0]}
    return made


def _all_of(views: list[Array]) -> Array:
    """Return arrays of views as one, without a copy of a single one."""
    return views[0][None] if len(views) == 1 else np.stack(views)


def stored_layers(
    batch: SceneBatch, image: int, depth: Array, object_id: Array
) -> dict[str, Array]:
    """Return `layers.layers_of` by name of the column."""
    columns = vars(layers_of(batch, image, depth, object_id))
    return {"object/closed": columns.pop("closed"), **{f"layers/{x}": columns[x] for x in columns}}


def visible_fraction(object_id: Array, masks: Array) -> NDArray[np.float32]:
    """Return which part of each object's silhouette shows it, (K,); 0 where there is none.

    Args:
        object_id: (H, W).
        masks: whole silhouettes, (K, H, W).
    """
    whole = masks.astype(bool).sum(axis=(1, 2))
    shown = np.array([np.count_nonzero(object_id == k + 1) for k in range(len(masks))])
    return np.asarray((shown / np.maximum(whole, 1)).astype(np.float32))


def coordinates(view: Any, world_from_object: Array) -> NDArray[np.float32]:
    """Return `derived.object_coordinates` of a view as they are stored, (H, W, 3)."""
    found = object_coordinates(view.points_world, view.object_id, world_from_object)
    return found.astype(np.float32)


def flow(view: Any, other: Any) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return the flow from a view to another one, (H, W, 2), and where it is occluded, (H, W).

    Occluded is 1 where the other view does not show the point, and where there is none.
    """
    moved = optical_flow(
        view.depth,
        view.world_from_camera,
        other.world_from_camera,
        view.lens,
        other.lens,
    )
    seen = seen_from(
        view.points_world,
        view.object_id,
        other.depth,
        other.normal,
        other.object_id,
        other.world_from_camera,
        other.lens,
    )
    return moved.astype(np.float32), (~seen).astype(np.uint8)


def truth_problems(
    spec: Request, stored: Mapping[str, Array], view: Any, other: Any, scene: Any
) -> Iterable[tuple[str, str]]:
    """Yield name of the truth and a sentence for each problem of one row.

    Args:
        spec: of the file.
        stored: values of the columns of this module, `material/reflectance` and
            `object/world_from_object` of the row.
        view, other: the row, and the one of the next view; `View`s or `Room`s.
        scene: its description.
    """
    truth = spec.truth
    for name, check in (("amodal", _amodal_problems), ("layers", _layer_problems)):
        if name in truth:
            for problem in check(stored, view, len(scene.objects)):
                yield name, problem
    if "coordinates" in truth:
        expected = coordinates(view, stored["object/world_from_object"])
        if not np.allclose(
            stored["object_coordinates"],
            expected,
            rtol=0,
            atol=COORDINATE_TOLERANCE,
            equal_nan=True,
        ):
            yield "coordinates", "object coordinates are not those of depth and poses"
    if "flow" in truth:
        moved, occluded = flow(view, other)
        if not np.allclose(stored["flow"], moved, rtol=0, atol=FLOW_TOLERANCE, equal_nan=True):
            yield "flow", "flow is not that of depth and cameras"
        if (stored["flow_occluded"] != occluded).mean() > EDGE_SHARE:
            yield "flow", "occlusion is not that of depth and cameras"
    if "albedo" in truth:
        for problem in _albedo_problems(spec, stored, view):
            yield "albedo", problem


def _albedo_problems(spec: Request, stored: Mapping[str, Array], view: Any) -> Iterable[str]:
    if spec.interior:
        values, hit = stored["albedo"], view.object_id >= 0
        if not ((values[hit] >= 0) & (values[hit] <= 1)).all():
            yield "albedo is not from 0 to 1"
    else:
        rho = albedo(view.object_id, stored["material/reflectance"]).astype(np.float32)
        own = (view.object_id > 0) & spec.own_reflectance
        if not np.array_equal(stored["albedo"][~own], rho[~own], equal_nan=True):
            yield "albedo is not the reflectance of the object ids"
        shares = stored["albedo"][own] / np.maximum(rho[own], 1e-12)
        if not ((shares >= 0) & (shares <= 1 + 1e-5)).all():
            yield "albedo of an object exceeds its reflectance"


def _layer_problems(stored: Mapping[str, Array], view: Any, count: int) -> Iterable[str]:
    depth, ids, entering = (stored[f"layers/{x}"] for x in ("depth", "object_id", "entering"))
    if not (
        np.array_equal(depth[..., 0], view.depth, equal_nan=True)
        and np.array_equal(ids[..., 0], view.object_id)
    ):
        yield "the first layer is not depth and object id"
    there = ids >= 0
    if (
        (np.isfinite(depth) != there).any()
        or (there[..., 1:] & ~there[..., :-1]).any()
        or ids.max() > count
    ):
        yield "layers without a surface come before others, or object ids are impossible"
    elif not (depth[..., 1:] >= depth[..., :-1])[there[..., 1:]].all():
        yield "layers are not in order"
    if np.abs(entering).max() > 1 or entering[ids <= 0].any():
        yield "entering has other values than -1, 0 and 1, or is not 0 where no object is"
    inside = [np.cumsum(np.where(ids == k + 1, entering, 0), axis=-1) for k in range(count)]
    if any(some.min() < 0 or some.max() > 1 for some in inside):
        yield "a ray enters an object twice, or leaves it before"
    if (stored["object/closed"] > 1).any() or stored["object/closed"][count:].any():
        yield "object/closed has other values than 0 and 1, or belongs to no object"


def _amodal_problems(stored: Mapping[str, Array], view: Any, count: int) -> Iterable[str]:
    masks = stored["object/amodal_mask"]
    if masks.max() > 1 or masks[count:].any():
        yield "a mask holds other values than 0 and 1, or belongs to no object"
        return
    fraction = visible_fraction(view.object_id, masks)
    if not np.array_equal(stored["object/visible_fraction"], fraction):
        yield "visible fractions are not those of masks and object ids"
    reach = _reach_of_spheres(view, stored["object/world_from_object"][:count])
    for k in range(count):
        mask = masks[k] > 0
        if not mask[view.object_id == k + 1].all():
            yield f"the mask of object {k + 1} lacks pixels that show it"
        if not (mask <= (reach[k] > 0)).all():
            yield f"the mask of object {k + 1} leaves its bounding sphere"
        elif not (view.depth[mask] <= reach[k][mask] + 1e-4).all():
            yield f"something farther than object {k + 1} shows in its mask"


def _reach_of_spheres(view: Any, world_from_object: Array) -> Array:
    """Return the depth at which each pixel's ray leaves each bounding sphere, (K, H, W).

    It is -1 where the ray misses the sphere.
    """
    height, width = view.depth.shape
    local = pixel_directions(height, width, view.lens)
    rays = transform_vectors(view.world_from_camera, local)
    squared = np.einsum("yxi,yxi->yx", rays, rays)
    reach = np.full((len(world_from_object), *view.depth.shape), -1.0)
    for k, matrix in enumerate(world_from_object):
        toward = matrix[:3, 3] - view.world_from_camera[:3, 3]
        middle = rays @ toward / squared
        radius = np.linalg.norm(matrix[:3, 0]) * 1.001
        inside = radius**2 - (toward @ toward - middle**2 * squared)
        reach[k] = np.where(inside > 0, middle + np.sqrt(np.maximum(inside, 0) / squared), -1.0)
    return reach

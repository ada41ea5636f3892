"""Amodal masks: the whole silhouette of each object, also where something stands before it.

An object's silhouette is what the same rays meet where it is alone, without the room.
"""

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.renderer import launch_fields

Array = NDArray[Any]
_SLOTS = ("shape", "world_from_object", "object_scale")  # arrays with an axis of object slots


def amodal_masks(batch: SceneBatch, device: str = "auto") -> NDArray[np.bool_]:
    """Return the pixels whose ray meets each object, (B, K, H, W); none for unused slots.

    The rays are those of depth and object ids, so that all pixels that show an object are in its
    mask. Parts outside the image do not count.

    Raises BackendError as `renderer.render`.
    """
    spec = batch.spec
    masks = np.zeros((len(batch), spec.object_slots, spec.height, spec.width), bool)
    image, slot = np.nonzero(np.arange(spec.object_slots) < batch.object_count[:, None])
    for start in range(0, len(image), len(batch)):  # no more images at once than the batch has
        some = slice(start, start + len(batch))
        alone = _alone(batch, image[some], slot[some])
        ids = launch_fields(alone, ("object_id",), device)()["object_id"]
        masks[image[some], slot[some]] = ids > 0
    return masks


def whole_pixels(batch: SceneBatch, image: Array, slot: Array, device: str = "auto") -> Array:
    """Return how many pixels objects would fill if nothing hid them, (n,).

    Parts beyond the border of an image count, too, up to half an image away from it.

    Args:
        image, slot: an image of the batch and a slot of objects, (n,) each.

    Raises BackendError as `renderer.render`.
    """
    spec = replace(batch.spec, height=2 * batch.spec.height, width=2 * batch.spec.width)
    x, y = batch.spec.principal_point
    spec = replace(spec, principal_point=(x / 2 + 0.25, y / 2 + 0.25))
    halves = np.tan(np.radians(batch.fov_y_degrees) / 2)
    fov = np.degrees(2 * np.arctan(2 * halves))  # pixels keep their size
    alone = _alone(replace(batch, spec=spec, fov_y_degrees=fov), image, slot)
    ids = launch_fields(alone, ("object_id",), device)()["object_id"]
    return np.asarray(np.count_nonzero(ids > 0, axis=(1, 2)))


def wide_masks(batch: SceneBatch, device: str = "auto") -> NDArray[np.bool_]:
    """Return `amodal_masks` on a canvas of three by three images, (B, K, 3H, 3W).

    The image itself is in the middle. Raises BackendError as `renderer.render`.
    """
    count, spec = len(batch), batch.spec
    down, right = np.divmod(np.arange(9), 3) - np.ones((2, 1), int)
    tiles = _beside(
        _chosen(batch, np.tile(np.arange(count), 9)), *np.repeat([right, down], count, 1)
    )
    masks = amodal_masks(tiles, device).reshape(3, 3, count, -1, spec.height, spec.width)
    return masks.transpose(2, 3, 0, 4, 1, 5).reshape(count, -1, 3 * spec.height, 3 * spec.width)


def _beside(batch: SceneBatch, right: Array, down: Array) -> SceneBatch:
    """Return images that adjoin those of a batch, so many widths to the right and heights down.

    They have the same image plane. So the matrix of such a camera is a shear: its third column
    points away from the middle of the adjoining image.
    """
    spec, matrix = batch.spec, batch.world_from_camera.copy()
    steps = np.stack([right * spec.width * spec.pixel_aspect, -down * spec.height], axis=1)
    offsets = steps * batch.pixel_heights[:, None]
    matrix[:, :3, 2] -= np.einsum("bic,bc->bi", matrix[:, :3, :2], offsets)
    return replace(batch, world_from_camera=matrix)


def _chosen(batch: SceneBatch, image: Array) -> SceneBatch:
    """Return images (n,) of the batch."""
    arrays: dict[str, Any] = {
        field.name: value[image]
        for field in fields(batch)
        if isinstance(value := getattr(batch, field.name), np.ndarray)
    }
    return replace(batch, **arrays)


def _alone(batch: SceneBatch, image: Array, slot: Array) -> SceneBatch:
    """Return images (n,) of the batch that show the object of one slot each, (n,)."""
    chosen = _chosen(batch, image)
    each = np.arange(len(image))
    arrays: dict[str, Any] = {}
    for name in _SLOTS:
        values = getattr(chosen, name)
        arrays[name] = np.full_like(values, -1 if name == "shape" else 0)
        arrays[name][:, 0] = values[each, slot]
    arrays["object_count"] = np.ones_like(chosen.object_count)
    arrays["has_room"] = np.zeros_like(chosen.has_room)
    return replace(chosen, cubes_only=False, **arrays)

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


def _alone(batch: SceneBatch, image: Array, slot: Array) -> SceneBatch:
    """Return images (n,) of the batch that show the object of one slot each, (n,)."""
    arrays: dict[str, Any] = {
        field.name: value[image]
        for field in fields(batch)
        if isinstance(value := getattr(batch, field.name), np.ndarray)
    }
    each = np.arange(len(image))
    for name in _SLOTS:
        lone = np.full_like(arrays[name], -1 if name == "shape" else 0)
        lone[:, 0] = arrays[name][each, slot]
        arrays[name] = lone
    arrays["object_count"] = np.ones_like(arrays["object_count"])
    arrays["has_room"] = np.zeros_like(arrays["has_room"])
    return replace(batch, cubes_only=False, **arrays)

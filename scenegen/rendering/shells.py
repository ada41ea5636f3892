"""The shells of closed rooms, cast as one more object of each scene.

So they need no kernel of their own: the shell takes the slot behind all others, and its pixels
get the id of the room afterwards.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.description.specs import Request
from scenegen.objects.furniture.room_shell import shell_name
from scenegen.rendering.packing import SceneBatch

Array = NDArray[Any]


def with_shells(batch: SceneBatch) -> SceneBatch:
    """Return a batch of closed rooms whose last slots hold their shells, and that has no rooms."""
    assert batch.interior is not None
    count, slots = batch.shape.shape
    spec = replace(batch.spec, objects=(batch.spec.objects[0], slots + 1))
    texts, which = np.unique(batch.interior.astype(str), return_inverse=True)
    shell = np.where(batch.has_room, len(batch.names) + which, -1).astype(np.int32)

    def more(values: Array, added: Any) -> Array:
        last = np.broadcast_to(np.asarray(added, values.dtype), (count, 1, *values.shape[2:]))
        return np.concatenate([values, last], axis=1)

    return replace(
        batch,
        spec=spec,
        names=(*batch.names, *map(shell_name, texts.tolist())),
        object_count=np.full(count, slots + 1),
        shape=np.concatenate([batch.shape, shell[:, None]], axis=1),
        world_from_object=more(batch.world_from_object, np.eye(4)),
        object_scale=more(batch.object_scale, 1.0),
        reflectance=more(batch.reflectance, 0.0),
        gloss=more(batch.gloss, (0.0, 1.0)),
        has_room=np.zeros(count, bool),
        interior=None,
    )


def without_shells(pixels: dict[str, Array], spec: Request) -> dict[str, Array]:
    """Give the pixels that show a shell the room's id, 0."""
    if "object_id" in pixels:
        ids = pixels["object_id"]
        ids[ids == spec.object_slots + 1] = 0
    return pixels

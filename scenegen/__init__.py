"""Rooms holding objects, rendered with exact ground truth.

Read a file:    `with scenegen.open_rooms("rooms.h5") as rooms: rooms[0].depth`
Train on it:    `scenegen.RoomsDataset("rooms.h5", fields=("image", "depth"))`
Make one:       `scenegen.make_dataset("rooms.h5", scenegen.DatasetSpec(seed=1), count=1000)`

Names are loaded when first used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenegen.camera import Camera, back_project
    from scenegen.common.errors import SceneGenError
    from scenegen.description.scenes import SceneSpec
    from scenegen.description.specs import DatasetSpec
    from scenegen.rendering.shading import shade
    from scenegen.rooms.make import make_dataset
    from scenegen.rooms.reader import Room, RoomsDataset, RoomsFile, open_rooms

_HOME = {
    "Camera": "camera",
    "DatasetSpec": "description.specs",
    "Room": "rooms.reader",
    "RoomsDataset": "rooms.reader",
    "RoomsFile": "rooms.reader",
    "SceneGenError": "common.errors",
    "SceneSpec": "description.scenes",
    "back_project": "camera",
    "make_dataset": "rooms.make",
    "open_rooms": "rooms.reader",
    "shade": "rendering.shading",
}

__all__ = [
    "Camera",
    "DatasetSpec",
    "Room",
    "RoomsDataset",
    "RoomsFile",
    "SceneGenError",
    "SceneSpec",
    "back_project",
    "make_dataset",
    "open_rooms",
    "shade",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'scenegen' has no attribute {name!r}")
    return getattr(import_module(f"scenegen.{_HOME[name]}"), name)

"""Rooms with objects, rendered with exact ground truth.

Read a file:    `with scenegen.open_rooms("rooms.h5") as rooms: rooms[0].depth`
Train on it:    `scenegen.RoomsDataset("rooms.h5", fields=("image", "depth"))`
Make one:       `scenegen.make_dataset("rooms.h5", scenegen.DatasetSpec(seed=1), count=1000)`

Names are loaded on first use, so importing the package is fast.
"""

from typing import TYPE_CHECKING

from scenegen.common.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenegen.camera import Camera as Camera
    from scenegen.camera import back_project as back_project
    from scenegen.common.errors import SceneGenError as SceneGenError
    from scenegen.description.presets import preset_spec as preset_spec
    from scenegen.description.scenes import SceneSpec as SceneSpec
    from scenegen.description.specs import DatasetSpec as DatasetSpec
    from scenegen.description.specs import InteriorSpec as InteriorSpec
    from scenegen.rendering.shading import shade as shade
    from scenegen.rooms.make import make_dataset as make_dataset
    from scenegen.rooms.reader import Room as Room
    from scenegen.rooms.reader import RoomsDataset as RoomsDataset
    from scenegen.rooms.reader import RoomsFile as RoomsFile
    from scenegen.rooms.reader import open_rooms as open_rooms
    from scenegen.rooms.stream import RoomStream as RoomStream

HOMES = {
    "camera": "Camera back_project",
    "common.errors": "SceneGenError",
    "description.presets": "preset_spec",
    "description.scenes": "SceneSpec",
    "description.specs": "DatasetSpec InteriorSpec",
    "rendering.shading": "shade",
    "rooms.make": "make_dataset",
    "rooms.reader": "Room RoomsDataset RoomsFile open_rooms",
    "rooms.stream": "RoomStream",
}
__all__ = [name for names in HOMES.values() for name in names.split()]
__getattr__ = lazy_names(__name__, HOMES)

"""Rows of a file of rooms from scenes that were rendered, packed to be written."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import intrinsics
from scenegen.common.records import from_json
from scenegen.description.interiors import Interior
from scenegen.description.scene_arrays import SceneArrays
from scenegen.files.schema import Column
from scenegen.files.table import PackedRows, pack_rows
from scenegen.rendering.packing import SceneBatch

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class RenderedScene:
    """An accepted item with the pixels of its V views.

    Attributes:
        scenes, row: its description is a row of `scenes`.
        batch, first: where it is packed: its views are the images from `first` on.
        pixels: image, depth, normal and object_id of the views, (V, ...) as in `GroundTruth`, and
            the columns of `layout.FURTHER` that the spec asks for.
        visible_pixels: how many pixels of each view show each object, (V, K).
    """

    scenes: SceneArrays
    row: int
    batch: SceneBatch
    first: int
    pixels: dict[str, Array]
    visible_pixels: Array

    @property
    def index(self) -> int:
        """The item's number in its data set."""
        return int(self.scenes.index[self.row])


def pack_rooms(
    rooms: Sequence[RenderedScene], columns: Sequence[Column], compression: str
) -> PackedRows:
    """Return a row for each view of each scene, at least one, packed to be written."""
    views, rows = len(rooms[0].visible_pixels), room_rows(rooms)
    rows["scene"] = [text for room in rooms for text in [room.scenes.to_json(room.row)] * views]
    return pack_rows(rows, columns, compression)


def room_rows(rooms: Sequence[RenderedScene]) -> dict[str, Any]:
    """Return the values of a row for each view of each scene, at least one, but for texts."""
    rows: dict[str, Any] = _described(rooms, len(rooms[0].visible_pixels))
    for name in rooms[0].pixels:
        rows[name] = [image for room in rooms for image in room.pixels[name]]
    rows["object/visible_pixels"] = np.concatenate([room.visible_pixels for room in rooms])
    return rows


def _described(rooms: Sequence[RenderedScene], views: int) -> dict[str, Array]:
    """Return what the rows hold that their scenes say, by name of the dataset."""
    batches = {id(room.batch): room.batch for room in rooms}
    images: dict[int, list[int]] = {key: [] for key in batches}
    places: dict[int, list[int]] = {key: [] for key in batches}
    for place, room in enumerate(rooms):
        key = id(room.batch)
        images[key] += range(room.first, room.first + views)
        places[key] += range(place * views, (place + 1) * views)
    parts = [described(batch, np.array(images[key])) for key, batch in batches.items()]
    order = np.argsort([place for some in places.values() for place in some])
    return {name: np.concatenate([part[name] for part in parts])[order] for name in parts[0]}


def described(batch: SceneBatch, images: Array) -> dict[str, Array]:
    """Return what rows hold that their scenes say, by name of the dataset: n rows of each.

    `images` are the numbers of the rows' images in the batch, (n,).
    """
    spec = batch.spec
    models = np.array([*batch.names, ""], object)  # -1, an unused slot, takes the last
    classes = [spec.shapes.index(name.partition("/")[0]) for name in batch.names]
    shape, view = batch.shape[images], batch.view[images]
    more = _interior(batch, images) if batch.interior is not None else {}
    fov = batch.fov_y_degrees[images]
    if spec.projection != "perspective":
        fov = np.full(len(images), 180.0)
    elif not batch.lens(0).is_centred:
        size = spec.height, spec.width
        matrices = [intrinsics(*size, batch.lens(i), pixel_centers="half") for i in images]
        more["camera/intrinsics"] = np.array(matrices)
    return {
        **more,
        "scene_index": batch.index[images],
        "view_index": view,
        "view_angle_degrees": np.array(spec.view_angles)[view],
        "camera/world_from_camera": batch.world_from_camera[images],
        "camera/fov_y_degrees": fov,
        "light/count": batch.light_count[images],
        "light/position": batch.light_position[images],
        "light/color": batch.light_color[images],
        "light/ambient": batch.ambient[images],
        "light/attenuation": batch.attenuation[images],
        "material/reflectance": batch.reflectance[images],
        "material/specular": batch.gloss[images, :, 0],
        "material/shininess": batch.gloss[images, :, 1],
        "object/count": batch.object_count[images],
        "object/shape": np.array([*classes, -1])[shape],
        "object/model": models[shape],
        "object/world_from_object": batch.world_from_object[images],
        "object/scale": batch.object_scale[images],
    }


def _interior(batch: SceneBatch, images: Array) -> dict[str, Array]:
    """Return the columns of `layout.INTERIOR` that scenes say."""
    assert batch.interior is not None
    rooms = [from_json(Interior, text, "interior") for text in batch.interior[images]]
    stands_on = np.full((len(images), batch.spec.object_slots), -1, np.int8)
    for row, room in zip(stands_on, rooms, strict=True):
        row[: len(room.stands_on)] = room.stands_on
    return {"object/stands_on": stands_on, "room/size": np.array([room.size for room in rooms])}

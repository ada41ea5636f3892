"""Recordings of rooms, read back by Rerun: what they hold is what the file says."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rerun")

from recordings import pixels_of, points_of, recorded

from scenegen import open_rooms
from scenegen.camera import Lens
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rooms.preview import normal_bytes, srgb_bytes
from scenegen.viewing import NO_OBJECT, room_scenes, room_view, scene_rows
from scenegen.viewing import write_recording as write


@pytest.fixture(params=["paper's rooms in shards", "interiors in metres"])
def path(request, make_rooms, interior_path, tmp_path):
    if request.param == "interiors in metres":
        return interior_path
    how, more = {"shard_size": 3}, {"width": 24, "truth": ("layers",)}
    return make_rooms(tmp_path / "set.h5", 3, how, views=(0, 40), fov_degrees=90.0, **more)


def test_a_recording_holds_the_truth_of_each_view(path, tmp_path):
    with open_rooms(path) as rooms:
        count = write(tmp_path / "x.rrd", "x", room_scenes(rooms, scene_rows(rooms)))
        assert count == len(rooms)
        there = recorded(tmp_path / "x.rrd", "scene")
        for room in rooms:
            step, view, shape = room.scene.index, f"view_{room.view_index}", room.depth.shape
            seen = np.isfinite(room.depth)
            points, colors = points_of(there[f"/world/truth/{view}"][step])
            np.testing.assert_allclose(points, room.points_world[seen], atol=2e-6)
            image = srgb_bytes(room.radiance)
            np.testing.assert_array_equal(colors[:, :3], image[seen])
            if "layers" in rooms.spec.truth:
                hidden, _ = points_of(there[f"/world/truth/{view}/hidden"][step])
                distance = -(hidden - room.world_from_camera[:3, 3]) @ room.world_from_camera[:3, 2]
                behind = room.truth["layers/depth"][..., 1:]
                np.testing.assert_allclose(distance, behind[np.isfinite(behind)], atol=2e-6)
            names = ("image", "truth_depth", "truth_normal", "object_id")
            pixels = {name: there[f"/pixels/{view}/{name}"][step] for name in names}
            depth = pixels_of(pixels["truth_depth"], "DepthImage", np.float32, shape)
            np.testing.assert_array_equal(depth, room.depth)
            shown = pixels_of(pixels["image"], "Image", np.uint8, (*shape, 3))
            np.testing.assert_array_equal(shown, image)
            ids = pixels_of(pixels["object_id"], "SegmentationImage", np.uint16, shape)
            np.testing.assert_array_equal(ids, room.object_id.astype(int) % (NO_OBJECT + 1))
            world = room.normal @ room.world_from_camera[:3, :3].T
            normal = pixels_of(pixels["truth_normal"], "Image", np.uint8, (*shape, 3))
            assert np.abs(normal.astype(int) - normal_bytes(world)).max() <= 1
        (classes,) = there["/pixels"][step]["AnnotationContext:context"]
        labels = [part["class_description"]["info"]["label"] for part in classes]
        assert labels == ["the room", *(item.shape for item in room.scene.objects), "nothing"]


def test_rows_and_cameras_that_cannot_be_shown(rooms_path):
    with open_rooms(rooms_path) as rooms:
        assert scene_rows(rooms, [5, 2, 5]) == [[2], [5]]
        with pytest.raises(SpecError):
            scene_rows(rooms, [3, len(rooms)])
        room = rooms[0]
    for changes in ({"lens": Lens(180.0)}, {"world_from_camera": np.eye(4) * np.nan}):
        with pytest.raises(FileFormatError):
            room_view(replace(room, **changes))
    with pytest.raises(SpecError):
        room_view(replace(room, lens=Lens(180.0, projection="equirectangular")))


def test_a_failed_recording_leaves_nothing(damaged, tmp_path):
    def no_angle(file):
        file["camera/fov_y_degrees"][5] = 0

    path = damaged(no_angle)
    with open_rooms(path) as rooms, pytest.raises(FileFormatError):
        write(tmp_path / "x.rrd", "x", room_scenes(rooms, scene_rows(rooms)))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]

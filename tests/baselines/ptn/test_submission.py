"""Submissions: what a volume looks like, files that can be scored, and refusals."""

import numpy as np
import pytest
from ptn_models import tiny, volume_of, voxel_centres

from baselines.ptn.rooms import RoomImages
from baselines.ptn.training import seen
from metrics.measures.relief import empty_room
from scenegen.rooms.reader import RoomsFile

VIEWS = {"views": (0.0, 80.0), "objects": (1, 1), "shapes": ("sphere",)}


def test_a_true_volume_gives_the_truths_depth_and_normals_in_every_view(make_rooms, tmp_path):
    size = {"height": 64, "width": 64, "object_radius": (0.12, 0.16)}
    path = make_rooms(tmp_path / "ball.h5", 2, **VIEWS, **size)
    model = tiny()
    with RoomsFile(path) as rooms:
        images = RoomImages(rooms, 16)
        for row in range(len(rooms)):
            room = rooms[row]
            place = rooms.read("object/world_from_object", row)[0, :3, 3]
            radius = float(rooms.read("object/scale", row)[0])
            for mirrored in (False, True):
                middle = place[::-1] if mirrored else place
                away = np.linalg.norm(voxel_centres(model) - middle, axis=-1) - radius
                depth, normal = seen(model, volume_of(away, 0.06), images, row, mirrored)
                inside = room.object_id > 0
                both = inside & (
                    depth < empty_room(images.poses[row], room.fov_y_degrees, 64, 64)[0]
                )
                assert both.sum() > 0.93 * inside.sum()
                assert np.abs(depth - room.depth)[both].mean() < 0.01
                cosine = (normal * room.normal).sum(axis=-1)[both]
                assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 8
                assert depth[~inside] == pytest.approx(room.depth[~inside], abs=0.2)

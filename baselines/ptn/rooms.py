"""Rooms for the networks: images of scenes, and silhouettes of the same scenes from other views.

The volume is the part of the room's unit box that objects can reach. The room looks the same in a
mirror that swaps x and z, so an image whose camera stands nearer the z axis is mirrored, and the
network only ever sees rooms from one side.
"""

import numpy as np
import torch

from baselines.ptn.network import Corner, Settings
from baselines.ptn.projection import Batch
from baselines.ptn.silhouettes import Silhouettes
from baselines.training.images import Array, check_reducible
from baselines.training.rooms import camera_poses, room_image
from scenegen.camera import pixel_directions
from scenegen.common.errors import SpecError
from scenegen.description.specs import DatasetSpec, Request
from scenegen.rooms.reader import RoomsFile

SWAPPED = (2, 1, 0)  # x, y, z of the mirrored room


def room_box(spec: Request) -> tuple[Corner, Corner]:
    """Return the corners of the part of the unit box that objects can reach."""
    assert isinstance(spec, DatasetSpec)  # `camera_poses` refuses others
    return (0.0, 0.0, 0.0), (1.0, min(1.0, 2 * spec.object_radius[1]), 1.0)


class RoomImages:
    """The images and cameras of a rooms file, mirrored where the network wants them so.

    Attributes:
        shape: height and width of the images, pixels.
        poses, fov_y_degrees: `world_from_camera` and field of view of each row's camera.
        mirrored: for each row, whether its image is mirrored for the encoder, (N,).
        rows_of: the rows of each scene, by view, so the first is the scene's input image.
    """

    def __init__(self, rooms: RoomsFile, size: int) -> None:
        """Read the cameras. Raises SpecError, FileFormatError."""
        check_reducible(rooms.path, rooms.spec.height, rooms.spec.width, size)
        self.rooms, self._size = rooms, size
        self.shape = rooms.spec.height, rooms.spec.width
        self.poses = camera_poses(rooms)
        self.fov_y_degrees: Array = rooms.read("camera/fov_y_degrees", slice(None))
        self.mirrored = self.poses[:, 2, 3] > self.poses[:, 0, 3]
        scene, view = (rooms.read(name, slice(None)) for name in ("scene_index", "view_index"))
        order = np.lexsort((view, scene))
        starts = np.flatnonzero(np.diff(scene[order])) + 1
        self.rows_of = np.split(order, starts)

    def image(self, row: int) -> Array:
        """Return an image as the encoder takes it, (3, S, S), mirrored if its row is."""
        small = room_image(self.rooms, row, self._size)
        return small[..., ::-1].copy() if self.mirrored[row] else small

    def camera(self, row: int) -> Array:
        """Return the position of a row's camera in the frame of that row's volume, (3,)."""
        place = self.poses[row, :3, 3]
        return place[[*SWAPPED]] if self.mirrored[row] else place

    def rays(self, row: int, pixels: Array | None = None) -> Array:
        """Return origins and directions of a row's rays, (2, R, 3), world; planar depth is 1.

        Args:
            pixels: numbers of pixels, counted row by row; by default all.
        """
        pose = self.poses[row]
        rays = pixel_directions(*self.shape, float(self.fov_y_degrees[row])).reshape(-1, 3)
        rays = rays if pixels is None else rays[pixels]
        directions = rays @ pose[:3, :3].T
        return np.stack([np.broadcast_to(pose[:3, 3], directions.shape), directions])


class TrainingRooms:
    """Scenes of several views, with silhouettes of all of them.

    Attributes:
        fingerprint, data: fingerprint and request of the file.
    """

    def __init__(self, rooms: RoomsFile, settings: Settings) -> None:
        """Check an open file. Raises SpecError where a scene has one view; as `RoomImages`."""
        self._images, self._settings = RoomImages(rooms, settings.size), settings
        single = [rows[0] for rows in self._images.rows_of if len(rows) < 2]
        if single:
            scene = int(rooms.read("scene_index", int(single[0])))
            expected = "two or more of every scene, as silhouettes of one view tell no shape"
            hint = "scenegen render --views 0,35,80 makes them"
            raise SpecError(f"{rooms.path}: scene {scene}", "one view", expected, hint)
        self.fingerprint, self.data = rooms.fingerprint, rooms.spec.to_json()
        self._silhouettes = Silhouettes(rooms, settings.silhouettes)

    def batch(self, rng: np.random.Generator) -> Batch:
        """Draw a batch: any view of a scene is the input, and the volume is seen from `views`."""
        settings, images = self._settings, self._images
        count = images.shape[0] * images.shape[1]
        made: list[tuple[Array, Array, Array, Array]] = []
        for scene in rng.integers(len(images.rows_of), size=settings.batch):
            rows = images.rows_of[scene]
            row = int(rng.choice(rows))
            mirrored = bool(images.mirrored[row])
            rays, meets = [], []
            again = len(rows) < settings.views
            for other in rng.choice(rows, size=settings.views, replace=again):
                pixels = rng.integers(count, size=settings.rays)
                world = images.rays(int(other), pixels)
                meets.append(self._silhouettes.at(int(other), pixels, *world))
                rays.append(world[..., [*SWAPPED]] if mirrored else world)
            joined = np.concatenate(rays, axis=1)
            made.append((images.image(row), images.camera(row), joined, np.concatenate(meets)))
        image, camera, rays_, shown = (
            torch.from_numpy(np.stack(part).astype(np.float32)) for part in zip(*made, strict=True)
        )
        return Batch(image, camera, rays_[:, 0], rays_[:, 1], shown)

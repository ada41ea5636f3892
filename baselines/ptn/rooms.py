"""Rooms for the networks: images of scenes, and silhouettes of the same scenes from other views.

The volume is the part of the room's unit box that objects can reach. The room looks the same in a
mirror that swaps x and z, so an image whose camera stands nearer the z axis is mirrored, and the
network only ever sees rooms from one side.

Silhouettes come from the image or, for the oracle variant, from the truth's ids. The image's way
uses what the model is told: the empty room is shaded with the known camera, lights and reflectance
of the walls, and a pixel that differs shows an object. This is exact up to rounding, as the paper's
shading equation knows no shadows and no light from other surfaces.
"""

import numpy as np
import torch

from baselines.ptn.network import Corner, Settings
from baselines.ptn.projection import Batch
from baselines.training.images import Array, check_reducible
from baselines.training.rooms import camera_poses, room_image
from scenegen.camera import pixel_directions
from scenegen.common.errors import SpecError
from scenegen.description.specs import DatasetSpec, Request
from scenegen.rendering.ground_truth import decode_image
from scenegen.rendering.shading import shade
from scenegen.rooms.reader import RoomsFile

ROUNDING = {"uint8": 0.75 / 255, "float16": 2e-3, "float32": 1e-4}  # of the stored radiance
LIGHTS = ("count", "position", "color", "ambient", "attenuation")
SWAPPED = (2, 1, 0)  # x, y, z of the mirrored room


class Silhouettes:
    """The silhouettes of a rooms file, at those pixels that are asked for."""

    def __init__(self, rooms: RoomsFile, source: str = "image") -> None:
        """Read the lights.

        Args:
            source: "image" for the difference from the empty room, "ids" for the truth.

        Raises SpecError where objects change the light on the walls, or pixels blend samples.
        """
        spec = rooms.spec
        if source == "image" and (spec.shading != "paper" or spec.shadows or spec.spp > 1):
            raise SpecError(
                rooms.path,
                "images with shadows, indirect light or several samples per pixel",
                "the paper's shading, in which a pixel unlike the empty room's shows an object",
                "take silhouettes from ids, which is the oracle variant",
            )
        self._rooms, self._source = rooms, source
        self._light = {name: rooms.read(f"light/{name}", slice(None)) for name in LIGHTS}
        self._walls: Array = rooms.read("material/reflectance", slice(None))[:, 0]

    def at(self, row: int, pixels: Array, origin: Array, direction: Array) -> Array:
        """Return whether pixels show an object, (R,) booleans.

        Args:
            pixels: numbers of pixels, counted row by row, (R,).
            origin, direction: of their rays, (R, 3), world.
        """
        if self._source == "ids":
            return np.asarray(self._rooms.read("object_id", row).reshape(-1)[pixels] > 0)
        stored = decode_image(self._rooms.read("image", row).reshape(-1, 3)[pixels])
        empty = self.empty_radiance(row, origin, direction)
        kind = self._rooms.spec.image_dtype
        empty = np.clip(empty, 0.0, 1.0) if kind == "uint8" else empty
        return np.asarray((np.abs(stored - empty) > ROUNDING[kind]).any(axis=-1))

    def empty_radiance(self, row: int, origin: Array, direction: Array) -> Array:
        """Return the linear radiance that rays see in the room without its objects, (R, 3)."""
        toward = np.where(direction < 0, direction, -1e-12)  # the planes lie at 0 of each axis
        reach = -origin / toward
        light, count = self._light, int(self._light["count"][row])
        return shade(
            origin + reach.min(axis=-1, keepdims=True) * direction,
            np.eye(3)[reach.argmin(axis=-1)],
            self._walls[row],
            *(light[name][row, :count] for name in ("position", "color")),
            *(light[name][row] for name in ("ambient", "attenuation")),
        )


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
            expected = "two or more per scene, because silhouettes of one view determine no shape"
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

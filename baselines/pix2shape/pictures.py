"""Pictures for people: sheets of images, depths and normals, and animations of them.

They show how training goes, and what a model has learned: samples, interpolations between images,
and other views.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor
from torch.utils.data import default_collate

from baselines.pix2shape.images import Batch, RoomImages, as_views
from baselines.pix2shape.network.model import Pix2Shape, Views, shaded
from baselines.pix2shape.network.surfels import Scene, normals_from_depth
from baselines.pix2shape.weights import Card
from baselines.training.data import shared_rooms
from baselines.training.images import Array, mapped
from scenegen import open_rooms
from scenegen.camera import Camera, look_at
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.common.names import check_choice
from scenegen.common.random.seeding import Purpose, item_seed
from scenegen.description.specs import DatasetSpec, request_from_json
from scenegen.files.images.pictures import check_picture_name, check_picture_size, save_picture
from scenegen.files.new_file import check_writable, written_beside
from scenegen.rooms import preview
from scenegen.rooms.preview import BACKGROUND, GAP, SMALLEST_TILE
from scenegen.sampling.cameras import sample_cameras
from scenegen.sampling.lights import sample_lights

Tiles = list[NDArray[np.uint8]]  # (H, W, 3) each
FRAME_MILLISECONDS = 80
ROW = 8  # tiles in a row of a sheet


@torch.no_grad()
def drawn(model: Pix2Shape, code: Tensor, views: Views) -> tuple[Tiles, Tiles, Tiles]:
    """Return tiles of images, depths (near is dark) and normals (xyz as rgb) of codes in views."""
    surfels = model.surfels(code, views.condition, views.cameras)
    depth, opacity = surfels.depth, surfels.opacity
    image = shaded(surfels, model.lit(code, views))
    if not (depth.isfinite().all() and image.isfinite().all()):
        hint = "these weights are for other rooms"
        raise SceneGenError("picture", "depth or radiance is not finite", hint=hint)
    normals = normals_from_depth(depth, views.scene.fov_y_degrees)
    if opacity is not None:
        depth = torch.where(opacity > 0.5, depth, torch.nan)
        normals = normals * (opacity > 0.5)[:, None]
    depths = [preview.depth_bytes(z.cpu().numpy()) for z in depth]
    xyz = np.moveaxis(normals.cpu().numpy(), 1, -1)
    return image_tiles(image), depths, list(preview.normal_bytes(xyz))


def image_tiles(radiance: Tensor) -> Tiles:
    """Return tiles of images of linear radiance, (B, 3, H, W), encoded as sRGB."""
    return [preview.srgb_bytes(np.moveaxis(image.cpu().numpy(), 0, -1)) for image in radiance]


def sheet(rows: Sequence[Tiles]) -> Image.Image:
    """Return a sheet of rows of tiles; small tiles are enlarged by a whole factor."""
    side = rows[0][0].shape[0]
    side *= -(-SMALLEST_TILE // side) if side < SMALLEST_TILE else 1
    columns, step = max(map(len, rows)), side + GAP
    picture = Image.new("RGB", (columns * step + GAP, len(rows) * step + GAP), BACKGROUND)
    for y, row in enumerate(rows):
        for x, pixels in enumerate(row):
            tile = Image.fromarray(pixels).resize((side, side), Image.Resampling.NEAREST)
            picture.paste(tile, (GAP + x * step, GAP + y * step))
    return picture


@torch.no_grad()
def training_sheet(model: Pix2Shape, batch: Batch, noise: Tensor, columns: int = 8) -> Image.Image:
    """Return the sheet that shows how training goes.

    Its rows are inputs; reconstructions, their depths and normals; samples of the prior, and their
    depths. Without an adversarial loss codes do not follow the prior during training; the last two
    rows then show the inputs' codes seen by the next input's camera.
    """
    learning = model.training
    model.eval()
    code = model.encode(batch.image, batch.views)
    again = drawn(model, code, batch.views)
    made = drawn(model, noise if model.config.adversarial else code.roll(1, 0), batch.views)
    model.train(learning)
    rows = [image_tiles(batch.image), *again, *made[:2]]
    return sheet([row[:columns] for row in rows])


def open_known_rooms(data: str | Path, card: Card) -> RoomImages:
    """Open rooms for a model to encode. Raises as `RoomImages`, and SpecError for other classes."""
    _check_camera(card)
    rooms = RoomImages(shared_rooms(open_rooms(data)), replace(card.settings, depth=0.0))
    if card.classes and rooms.classes != card.classes:
        expected = f"{', '.join(card.classes)}, as the model knows"
        raise SpecError(data, f"classes {', '.join(rooms.classes)}", expected)
    return rooms


def sample_sheet(
    model: Pix2Shape, card: Card, count: int, seed: int, label: str | None = None
) -> Image.Image:
    """Draw codes from the model's prior; cameras and lights are drawn as for the training data.

    The sheet has rows of images, of depths and of normals.

    Args:
        label: class of a conditional model's samples; None takes each class in turn.

    Raises SpecError for a label that the model does not know, and for a model of questions.
    """
    _check_camera(card)
    spec = request_from_json(card.data.partition("\n")[0])
    if not isinstance(spec, DatasetSpec):
        raise SpecError("weights", "trained on closed rooms", "the paper's rooms")
    spec = replace(spec, seed=seed)
    if label is not None:
        none = "" if card.classes else "none: it knows no classes"
        check_choice("class", label, card.classes, expected=none)
    one_hot = np.zeros((count, len(card.classes)))
    for i in range(count if card.classes else 0):
        one_hot[i, i % len(card.classes) if label is None else card.classes.index(label)] = 1
    items = np.arange(count)
    positions = sample_cameras(replace(spec, views=(0.0,)), items)[:, 0]
    views = unrendered_views(spec, positions, *sample_lights(spec, items)[1:], one_hot)
    source = torch.Generator().manual_seed(item_seed(seed, 0, Purpose.PICTURES))
    noise = torch.randn(count, model.config.networks.z, generator=source)
    tiles = drawn(model, model.prior(noise, views.condition), views)
    lines = [line[i : i + ROW] for i in range(0, count, ROW) for line in tiles]
    return sheet(lines)


def interpolation_sheet(
    model: Pix2Shape, rooms: RoomImages, first: int, last: int, steps: int
) -> Image.Image:
    """Go from one image's code to another's in equal steps, seen from the first one's camera.

    The two images themselves are the first and the last tile of the sheet's first row.
    """
    batch = rooms.as_batch(default_collate([rooms[first], rooms[last]]))
    with torch.no_grad():
        code = model.encode(batch.image, batch.views)
    share = torch.linspace(0, 1, steps)[:, None]
    views = mapped(batch.views, lambda values: values[:1].expand(steps, *values.shape[1:]))
    images, depths, normals = drawn(model, (1 - share) * code[:1] + share * code[1:], views)
    start, end = image_tiles(batch.image)
    blank = np.full_like(start, 250)
    return sheet([[start, *images, end], [blank, *depths, blank], [blank, *normals, blank]])


def rotation_frames(
    model: Pix2Shape, rooms: RoomImages, rows: Sequence[int], degrees: Sequence[float]
) -> list[Image.Image]:
    """Turn the camera about the vertical axis through its target; return a sheet for each angle.

    The camera turns to the side where it stays longer in front of the room's two walls. A sheet
    has rows of the input images, and of images, depths and normals at the angle.
    """
    batch = rooms.as_batch(default_collate([rooms[row] for row in rows]))
    with torch.no_grad():
        code = model.encode(batch.image, batch.views)
    assert isinstance(rooms.spec, DatasetSpec)  # others are refused with their poses
    inputs, frames = image_tiles(batch.image), []
    for angle in degrees:
        cameras = [turned_camera(rooms.world_from_camera[row], rooms.spec, angle) for row in rows]
        poses = [camera.world_from_camera for camera in cameras]
        told = list(map(rooms.view, rows, poses))
        views = as_views(default_collate(told), rooms.spec.fov_y_degrees)
        frames.append(sheet([inputs, *drawn(model, code, views)]))
    return frames


def turned_camera(world_from_camera: Array, spec: DatasetSpec, degrees: float) -> Camera:
    """Return a camera turned about the vertical axis through its target."""
    x, y, z = (float(v) for v in world_from_camera[:3, 3] - spec.camera_target)
    azimuth, radius = math.atan2(z, x), math.hypot(x, z)
    azimuth += math.radians(degrees if azimuth < math.pi / 4 else -degrees)
    offset = (radius * math.cos(azimuth), y, radius * math.sin(azimuth))
    place = (np.array(offset) + spec.camera_target).tolist()
    return Camera((place[0], place[1], place[2]), spec.camera_target, spec.fov_y_degrees)


def unrendered_views(
    spec: DatasetSpec, positions: Array, light_position: Array, light_color: Array, one_hot: Array
) -> Views:
    """Return the cameras, lights and reflectance of views that were never rendered.

    Cameras are at `positions`, (N, 3), and look at the spec's target; lights are (N, L, 3), world.
    """
    poses = look_at(positions, np.array(spec.camera_target))
    lights = (light_position - positions[:, None]) @ poses[:, :3, :3]
    condition = np.concatenate([positions, one_hot], axis=1)
    same = (spec.ambient, spec.attenuation, spec.room_reflectance)
    each = (np.tile(values, (len(positions), 1)) for values in same)
    arrays = (condition, poses, lights, light_color, *each)
    told, pose, *scene = (torch.from_numpy(np.float32(values)) for values in arrays)
    return Views(told, Scene(spec.fov_y_degrees, *scene), world_from_camera=pose)


def _check_camera(card: Card) -> None:
    if not card.settings.networks.camera:
        raise SpecError("weights", "a model of questions", "one of rooms")


def check_picture(path: str | Path, animated: bool, overwrite: bool) -> None:
    """Raise now what `save_pictures` would raise once all is drawn."""
    path = Path(path)
    if not animated:
        check_picture_name(path)
    elif path.suffix.lower() not in (".gif", ".webp"):
        raise SpecError("out", repr(path.name), "the name of an animation, such as turn.gif")
    check_writable(path, overwrite)


def save_pictures(frames: Sequence[Image.Image], path: str | Path, overwrite: bool = False) -> None:
    """Write one picture, or several as an animation that plays forwards and backwards.

    Raises SpecError for a file name with another ending, or of a format whose pictures cannot be so
    large, and OSError for the path.
    """
    check_picture(path, len(frames) > 1, overwrite)
    if len(frames) == 1:
        save_picture(frames[0], path, overwrite)
        return
    rest, pause = [*frames[1:], *frames[-2:0:-1]], FRAME_MILLISECONDS
    check_picture_size(frames[0], Path(path))
    with written_beside(path, overwrite) as temporary:
        frames[0].save(temporary, save_all=True, append_images=rest, duration=pause, loop=0)

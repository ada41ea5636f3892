"""Pictures for people: sheets of images, depths and normals, and animations of them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor

from baselines.pix2shape.batch import Batch
from baselines.pix2shape.network.model import Pix2Shape, Views, shaded
from baselines.pix2shape.network.surfels import normals_from_depth
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.files.new_file import check_writable, written_beside
from scenegen.files.pictures import check_picture_name, check_picture_size, save_picture
from scenegen.rooms import preview
from scenegen.rooms.preview import BACKGROUND, GAP, SMALLEST_TILE

Tiles = list[NDArray[np.uint8]]  # (H, W, 3) each
FRAME_MILLISECONDS = 80


@torch.no_grad()
def drawn(model: Pix2Shape, code: Tensor, views: Views) -> tuple[Tiles, Tiles, Tiles]:
    """Return tiles of images, depths (near is dark) and normals (xyz as rgb) of codes in views."""
    surfels = model.surfels(code, views.condition, views.cameras)
    depth, opacity = surfels.depth, surfels.opacity
    image = shaded(surfels, model.lit(code, views))
    if not (depth.isfinite().all() and image.isfinite().all()):
        hint = "these weights do not suit these rooms"
        raise SceneGenError("picture", "depth or radiance that is not finite", hint=hint)
    normals = normals_from_depth(depth, views.scene.fov_y_degrees)
    if opacity is not None:
        depth = torch.where(opacity > 0.5, depth, torch.nan)
        normals = normals * (opacity > 0.5)[:, None]
    depths = [preview.depth_bytes(z.cpu().numpy()) for z in depth]
    xyz = np.moveaxis(normals.cpu().numpy(), 1, -1)
    colors = np.rint(np.clip(xyz * 0.5 + 0.5, 0, 1) * 255).astype(np.uint8)
    return image_tiles(image), depths, list(colors)


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


def check_picture(path: str | Path, animated: bool, overwrite: bool) -> None:
    """Raise now what `save_pictures` would raise once all is drawn."""
    path = Path(path)
    if not animated:
        check_picture_name(path)
    elif path.suffix.lower() not in (".gif", ".webp"):
        raise SpecError("out", repr(path.name), "an animation's name such as turn.gif")
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

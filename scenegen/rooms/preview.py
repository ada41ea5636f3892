"""Contact sheets: pictures of some rows of a file, for a person to check it by eye."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from scenegen.common.srgb import encoded
from scenegen.rooms.reader import Room

Array = NDArray[Any]
GAP = 6
LABEL_HEIGHT = 18
SMALLEST_TILE = 128  # pixels; narrower images are enlarged by a whole factor
BACKGROUND, INK, FAINT = (250, 250, 250), (20, 20, 20), (110, 110, 110)
NOTHING = (90, 0, 110)  # colour of pixels whose ray meets nothing
PALETTE = np.array(  # of object ids: the room is grey; objects repeat Okabe and Ito's colours
    [(200, 200, 200), (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66),
     (0, 114, 178), (213, 94, 0), (204, 121, 167)],
    np.uint8,
)  # fmt: skip
TITLES = ("image", "depth, near is dark", "normal, xyz as rgb", "object id")


def contact_sheet(rooms: Sequence[Room], columns: int = 2) -> Image.Image:
    """Return a sheet with four labelled tiles for each room, `columns` rooms side by side."""
    height, width = rooms[0].depth.shape
    factor = -(-SMALLEST_TILE // width) if width < SMALLEST_TILE else 1
    tile = (width * factor, height * factor)
    cell = (4 * (tile[0] + GAP) + 2 * GAP, tile[1] + LABEL_HEIGHT + GAP)
    columns = min(columns, len(rooms))
    lines = -(-len(rooms) // columns)
    sheet = Image.new(
        "RGB", (columns * cell[0] + GAP, lines * cell[1] + LABEL_HEIGHT + GAP), BACKGROUND
    )
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=12)
    for column in range(columns):
        for k, title in enumerate(TITLES):
            left = GAP + column * cell[0] + k * (tile[0] + GAP)
            draw.text((left, 3), title, fill=INK, font=font)
    for i, room in enumerate(rooms):
        left, top = GAP + i % columns * cell[0], LABEL_HEIGHT + i // columns * cell[1]
        for k, pixels in enumerate(tiles(room)):
            picture = Image.fromarray(pixels).resize(tile, Image.Resampling.NEAREST)
            sheet.paste(picture, (left + k * (tile[0] + GAP), top))
        text = _fitted(_caption(room), font, cell[0] - 3 * GAP)
        draw.text((left, top + tile[1] + 2), text, fill=FAINT, font=font)
    return sheet


def tiles(room: Room) -> list[NDArray[np.uint8]]:
    """Return the four pictures of a room, each (H, W, 3) uint8."""
    nothing = room.object_id < 0
    pictures = [
        srgb_bytes(room.radiance),
        depth_bytes(room.depth),
        normal_bytes(room.normal),
        id_colors(room.object_id),
    ]
    for picture in pictures:
        picture[nothing] = NOTHING
    return pictures


def srgb_bytes(radiance: Array) -> NDArray[np.uint8]:
    """Encode linear radiance, 0 to 1, as sRGB in 8 bits."""
    return np.asarray(np.rint(encoded(radiance) * 255).astype(np.uint8))


def depth_bytes(depth: Array) -> NDArray[np.uint8]:
    """Show a depth map in grey, (H, W) -> (H, W, 3): black nearest, white farthest."""
    known = np.isfinite(depth)
    if not known.any():
        return np.zeros((*depth.shape, 3), np.uint8)
    near, far = depth[known].min(), depth[known].max()
    scaled = (np.where(known, depth, near) - near) / max(far - near, 1e-12)
    return np.repeat(np.rint(scaled * 255).astype(np.uint8)[..., None], 3, axis=-1)


def normal_bytes(normal: Array) -> NDArray[np.uint8]:
    """Show unit normals as colours, (H, W, 3): x, y and z as red, green and blue; -1 is black."""
    return np.asarray(np.rint(np.clip(normal * 0.5 + 0.5, 0, 1) * 255).astype(np.uint8))


def id_colors(object_id: Array) -> NDArray[np.uint8]:
    """Return a colour of PALETTE for each object id, (H, W) -> (H, W, 3); the room is grey."""
    ids = object_id.astype(np.int64)
    return PALETTE[np.where(ids > 0, (ids - 1) % (len(PALETTE) - 1) + 1, 0)]


def _caption(room: Room) -> str:
    shapes = ", ".join(item.shape for item in room.scene.objects) or "empty"
    known = room.depth[np.isfinite(room.depth)]
    span = f"depth {known.min():.2f}-{known.max():.2f}" if known.size else "nothing in view"
    turned = f"   {room.view_angle_degrees:g}°" if len(room.scene.cameras) > 1 else ""
    return f"#{room.index}{turned}   {span}   {shapes}"


def _fitted(text: str, font: Any, width: int) -> str:
    """Return a text, shortened where it is wider than `width` pixels."""
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "...") > width:
        text = text[:-1]
    return text + "..."

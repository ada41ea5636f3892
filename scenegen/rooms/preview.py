"""Contact sheets: pictures of some rows of a file, for a person to check it by eye."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from scenegen.common.srgb import encoded
from scenegen.rooms.reader import Room

Array = NDArray[Any]
LAYERS = "layers/depth"
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
CUTS = ("cut from above", "cut from the side")  # of files with layers


def contact_sheet(rooms: Sequence[Room], columns: int = 2) -> Image.Image:
    """Return a sheet with labelled tiles for each room, `columns` rooms side by side."""
    titles = TITLES + (CUTS if LAYERS in rooms[0].truth else ())
    height, width = rooms[0].depth.shape
    factor = -(-SMALLEST_TILE // width) if width < SMALLEST_TILE else 1
    tile = (width * factor, height * factor)
    cell = (len(titles) * (tile[0] + GAP) + 2 * GAP, tile[1] + LABEL_HEIGHT + GAP)
    columns = min(columns, len(rooms))
    lines = -(-len(rooms) // columns)
    sheet = Image.new(
        "RGB", (columns * cell[0] + GAP, lines * cell[1] + LABEL_HEIGHT + GAP), BACKGROUND
    )
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=12)
    for column in range(columns):
        for k, title in enumerate(titles):
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
    """Return the pictures of a room, each (H, W, 3) uint8; those of CUTS where it has layers."""
    nothing = room.object_id < 0
    pictures = [
        srgb_bytes(room.radiance),
        depth_bytes(room.depth),
        normal_bytes(room.normal),
        id_colors(room.object_id),
    ]
    for picture in pictures:
        picture[nothing] = NOTHING
    if LAYERS in room.truth:
        layers = [room.truth[f"layers/{x}"] for x in ("depth", "object_id", "entering")]
        pictures += cuts(layers, *cut_places(layers[2]))
    return pictures


def cut_places(entering: Array) -> tuple[int, int]:
    """Return the row and the column in which most rays enter an object, of layers (H, W, L)."""
    enters = (entering == 1).any(axis=-1)
    return int(enters.sum(axis=1).argmax()), int(enters.sum(axis=0).argmax())


def cuts(
    layers: Sequence[Array], row: int, column: int, ends: tuple[float, float] | None = None
) -> list[NDArray[np.uint8]]:
    """Return cuts along a row and a column of an image, (H, W, 3) each, with depth on one axis.

    Objects have the colours of their ids, what is behind the room's surface is grey.

    Args:
        layers: depth, object_id and entering, (H, W, L), as in `layers.Layers`.
        ends: least and largest depth that are shown; by default those of the layers.
    """
    depth = layers[0]
    height, width = depth.shape[:2]
    known = depth[np.isfinite(depth)]
    near, far = ends or (float(known.min(initial=1.0)), float(known.max(initial=1.0)))
    margin = 0.05 * max(far - near, 1e-6)
    levels = [np.linspace(near - margin, far + margin, n) for n in (height, width)]
    above = _cut([x[row].T for x in layers], levels[0])[::-1]
    aside = _cut([x[:, column].T for x in layers], levels[1]).transpose(1, 0, 2)
    return [above, aside]


def _cut(layers: Sequence[Array], levels: Array) -> NDArray[np.uint8]:
    """Return colours at depths (K,) of N rays, (K, N, 3), from their layers, (L, N)."""
    picture = np.full((len(levels), layers[0].shape[1], 3), 255, np.uint8)
    inside, room = np.zeros(layers[0].shape[1], np.int64), PALETTE[0]
    step = levels[1] - levels[0]
    for depth, number, kind in zip(*layers, strict=True):
        inside = np.where(kind == 1, number, np.where((kind == -1) & (inside == number), 0, inside))
        behind = levels[:, None] >= np.where(np.isfinite(depth), depth, np.inf)
        drawn = np.where(inside > 0, inside, 0)
        colors = np.where((drawn > 0)[:, None], id_colors(drawn), 255)
        colors = np.where((number == 0)[:, None], room, colors).astype(np.uint8)
        picture = np.where(behind[..., None], colors, picture)
        sheet = behind & (levels[:, None] < depth + step) & ((kind == 0) & (number > 0))
        picture[sheet] = np.broadcast_to(id_colors(number), picture.shape)[sheet]
    return picture


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

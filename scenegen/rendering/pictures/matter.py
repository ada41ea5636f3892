"""A furnished room as arrays of one form: triangles, and tables of their materials."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.rotations import product
from scenegen.description.interiors import WALLS
from scenegen.objects.furniture import furnished
from scenegen.objects.room_shell import PARTS, shell_name, shell_of
from scenegen.rendering.materials.folders import MapFiles
from scenegen.rendering.materials.kinds import material
from scenegen.rendering.materials.material import Material
from scenegen.rendering.materials.palettes import Palette, palette
from scenegen.rendering.packing import SceneBatch

Array = NDArray[Any]
Folder = Mapping[str, tuple[MapFiles, ...]] | None
TEXEL_RANGE = 255.0
GLOW = "glow"
ACCENT_SHARE = 0.35  # of rooms in which one wall has another colour
LAMP_FLUX = 0.018  # of a lamp, in the units of the sky's radiance times square metres
CEILING_FLUX = 0.13
LEAST_GLOW = 0.06  # square metres; what is smaller shines less, not more brightly
WARM = (1.0, 0.72, 0.44)  # linear RGB of lamps, of some 3000 K
OUT_OF_SIGHT = -50.0  # height in metres of triangles that only fill tables
LEAST_SHINING = 4096
FULL = 64  # triangles, of which the number of those that reflect is a multiple


@dataclass(frozen=True, eq=False)
class Tables:
    """Materials of triangles, as `matter_bsdf` looks them up.

    Attributes:
        of_face: row of each triangle's material, (F,) uint32.
        rows: of M materials, (M, 12) float32: first texel, width and height of its colours; metres
            of a repeat; metallic, specular, two unused; first value, width and height of its bumps,
            which are 0 for smooth ones; one unused.
        texels: square roots of linear RGB, and roughness, 8 bits each, uint32.
        heights: of bumps, metres, float32.
    """

    of_face: Array
    rows: Array
    texels: Array
    heights: Array


@dataclass(frozen=True, eq=False)
class Soup:
    """Triangles: corners and normals, world, (F, 3, 3); texture coordinates, metres, (F, 3, 2)."""

    corners: Array
    normals: Array
    uv: Array


@dataclass(frozen=True, eq=False)
class Matter:
    """What a room holds.

    Attributes:
        soup, tables: of all that reflects.
        glowing, radiance: triangles that shine, and their linear RGB, (G, 3).
    """

    soup: Soup
    tables: Tables
    glowing: Soup
    radiance: Array


class _Collector:
    """Collects triangles and materials."""

    def __init__(self, seed: int, index: int, colors: Palette, folder: Folder) -> None:
        self.folder = folder
        self.seed, self.index, self.colors = seed, index, colors
        self.materials: list[Material] = []
        self.numbers: dict[tuple[str, int], int] = {}
        self.parts: list[tuple[Array, Array, Array, Array]] = []
        self.glowing: list[tuple[Array, Array, Array, Array]] = []

    def number(self, kind: str, owner: str, part: int) -> int:
        """Return the number of a material, which is drawn where it is new."""
        key = f"{owner} {kind}", part
        if key not in self.numbers:
            self.numbers[key] = len(self.materials)
            stream = (self.seed, *owner.encode(), part)
            rng = item_rng(stream, self.index, Purpose.MATERIALS)
            self.materials.append(material(kind, rng, self.colors, self.folder))
        return self.numbers[key]

    def add(self, corners: Array, normals: Array, uv: Array, rows: Array) -> None:
        """Add triangles with the numbers of their materials."""
        self.parts.append((corners, normals, uv, rows))

    def shine(self, corners: Array, normals: Array, uv: Array, flux: float) -> None:
        """Add triangles that together shine with a flux."""
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * float(np.sqrt((across**2).sum(axis=1)).sum())
        radiance = np.array(WARM) * flux / (np.pi * max(area, LEAST_GLOW))
        self.glowing.append((corners, normals, uv, np.tile(radiance, (len(corners), 1))))


def room_palette(seed: int, index: int) -> Palette:
    """Return the colours of an item's room."""
    return palette(item_rng(seed, index, Purpose.MATERIALS))


def room_kinds(seed: int, index: int) -> tuple[str, ...]:
    """Return the kinds of materials of a shell's parts; in some rooms one wall stands out."""
    rng = item_rng(seed, index, Purpose.MATERIALS, 1)
    accent = WALLS[int(rng.random() * len(WALLS))] if rng.random() < ACCENT_SHARE else ""
    return tuple("wall" if k in WALLS and k != accent else "accent" if k in WALLS else k
                 for k in PARTS)  # fmt: skip


def gather_matter(batch: SceneBatch, b: int, lit: bool, folder: Folder = None) -> Matter:
    """Return what image `b` of a batch shows, of materials from a folder where that has some."""
    assert batch.interior is not None
    index, seed = int(batch.index[b]), batch.spec.seed
    collected = _Collector(seed, index, room_palette(seed, index), folder)
    room = shell_of(shell_name(batch.interior[b]))
    flat = np.repeat(room.normals[:, None], 3, axis=1)
    kinds = room_kinds(seed, index)
    rows = np.array([collected.number(kind, "room", i) for i, kind in enumerate(kinds)])
    shines = (room.part == PARTS.index(GLOW)) & lit
    collected.add(*(x[~shines] for x in (room.corners, flat, room.uv, rows[room.part])))
    if shines.any():
        glowing = room.corners[shines], flat[shines], room.uv[shines]
        collected.shine(*glowing, CEILING_FLUX)
    for k in range(int(batch.object_count[b])):
        name = batch.names[batch.shape[b, k]]
        thing, vertices, _ = furnished(name)
        placed, scale = batch.world_from_object[b, k], batch.object_scale[b, k]
        turned = placed[:3, :3]
        points = product(vertices, turned.T) + placed[:3, 3]
        normals = product(thing.corner_normals.reshape(-1, 3), turned.T / scale).reshape(-1, 3, 3)
        corners = points[thing.faces]
        rows = np.array([collected.number(kind, name, i) for i, kind in enumerate(thing.materials)])
        glows = np.array([kind == GLOW for kind in thing.materials])[thing.part] & lit
        dark = ~glows
        collected.add(corners[dark], normals[dark], thing.corner_uv[dark], rows[thing.part[dark]])
        if glows.any():
            collected.shine(corners[glows], normals[glows], thing.corner_uv[glows], LAMP_FLUX)
    # Dr.Jit reads several values at once where a table's length allows it, and searches the lights
    # in as many steps as their number needs: with full tables, all rooms share a kernel.
    triangles = sum(len(part[0]) for part in collected.parts)
    collected.add(*_unseen(-triangles % FULL), np.zeros(-triangles % FULL, int))
    shining = sum(len(part[0]) for part in collected.glowing)
    more = max(LEAST_SHINING, 1 << shining.bit_length()) - shining
    collected.glowing.append((*_unseen(more), np.zeros((more, 3))))
    *soup, of_face = (np.concatenate(x) for x in zip(*collected.parts, strict=True))
    *lights, radiance = (np.concatenate(x) for x in zip(*collected.glowing, strict=True))
    return Matter(Soup(*soup), _tables(collected.materials, of_face), Soup(*lights), radiance)


def _unseen(count: int) -> tuple[Array, Array, Array]:
    """Return corners, normals and texture coordinates of triangles far below the room."""
    triangle = np.array([[0, OUT_OF_SIGHT, 0], [1e-3, OUT_OF_SIGHT, 0], [0, OUT_OF_SIGHT, 1e-3]])
    up, nowhere = np.tile([0.0, 1.0, 0.0], (3, 1)), np.zeros((3, 2))
    corners, normals, uv = (np.repeat(x[None], count, axis=0) for x in (triangle, up, nowhere))
    return corners, normals, uv


def _tables(materials: list[Material], of_face: Array) -> Tables:
    rows = np.zeros((len(materials), 12), np.float32)
    texels: list[Array] = []
    heights: list[Array] = [np.zeros(1, np.float32)]
    first_texel, first_height = 0, 1
    for row, one in zip(rows, materials, strict=True):
        packed = _packed(one)
        row[:4] = first_texel, packed.shape[1], packed.shape[0], one.metres
        row[4:6] = one.metallic, one.specular
        texels.append(packed.ravel())
        first_texel += packed.size
        if one.height is not None:
            row[8:11] = first_height, one.height.shape[1], one.height.shape[0]
            heights.append(one.height.ravel())
            first_height += one.height.size
    return Tables(of_face.astype(np.uint32), rows, np.concatenate(texels), np.concatenate(heights))


def _packed(one: Material) -> Array:
    """Return colours and roughness of a material as texels, (H, W) uint32."""
    color, rough = np.asarray(one.base_color, np.float32), np.asarray(one.roughness, np.float32)
    color = color if color.ndim == 3 else color[None, None]
    rough = rough if rough.ndim == 2 else rough[None, None]
    height, width = max(len(color), len(rough)), max(color.shape[1], rough.shape[1])
    bytes_ = np.empty((height, width, 4), np.uint8)
    bytes_[..., :3] = np.rint(np.sqrt(np.clip(color, 0, 1)) * np.float32(TEXEL_RANGE))
    bytes_[..., 3] = np.rint(np.clip(rough, 0, 1) * np.float32(TEXEL_RANGE))
    return bytes_.view("<u4")[..., 0]

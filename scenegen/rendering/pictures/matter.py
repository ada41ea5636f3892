"""A furnished room as arrays of one form: triangles, and tables of their materials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.rotations import product
from scenegen.description.interiors import WALLS
from scenegen.objects.furniture.furnishing import Furnishing, Texture
from scenegen.objects.furniture.room_shell import PARTS, shell_name, shell_of
from scenegen.rendering.materials.folders import MapFiles
from scenegen.rendering.materials.kinds import material
from scenegen.rendering.materials.material import SLOPE_STEPS, Material
from scenegen.rendering.materials.palettes import Palette, palette
from scenegen.rendering.packing import SceneBatch

Array = NDArray[Any]
Folder = Mapping[str, tuple[MapFiles, ...]] | None
GLOW = "glow"
ACCENT_SHARE = 0.35  # of rooms in which one wall has another colour
LAMP_FLUX = 0.018  # of a lamp, in the units of the sky's radiance times square metres
CEILING_FLUX = 0.13
ALIGNED = 256  # texels, of which each map begins at a multiple: float32 tells it up to 2**32
LEAST_GLOW = 0.06  # square metres; what is smaller shines less, not more brightly
WARM = (1.0, 0.72, 0.44)  # linear RGB of lamps, of some 3000 K


@dataclass(frozen=True, eq=False)
class Tables:
    """Materials of triangles, as `closed_rooms` looks them up.

    Attributes:
        of_face: row of each triangle's material, (F,) uint32.
        rows: of M materials, (M, 16) float32: first texel, width and height of its colours; metres
            of a repeat; metallic, specular, wrap along u and v; first value, width and height of
            its slopes, and their factor; radiance, linear RGB; one unused.
        texels, slopes: as from `Material.texels` and `material.slopes_of`.
    """

    of_face: Array
    rows: Array
    texels: Array
    slopes: Array


class Soup(NamedTuple):
    """Triangles: corners and normals, world, (F, 3, 3); texture coordinates, metres, (F, 3, 2)."""

    corners: Array
    normals: Array
    uv: Array


class Matter(NamedTuple):
    """What a room holds: triangles, and their materials."""

    soup: Soup
    tables: Tables


class Collector:
    """Collects the triangles and materials of an item's room."""

    def __init__(self, seed: int, index: int, folder: Folder) -> None:
        self.folder = folder
        self.seed, self.index, self.colors = seed, index, room_palette(seed, index)
        self.materials: list[Material] = []
        self.numbers: dict[tuple[str, int], int] = {}
        self.parts: list[tuple[Array, Array, Array, Array]] = []

    def number(self, kind: str, owner: str, part: int) -> int:
        """Return the number of a material, which is drawn where it is new."""
        key = f"{owner} {kind}", part
        if key not in self.numbers:
            self.numbers[key] = len(self.materials)
            stream = (self.seed, *owner.encode(), part)
            rng = item_rng(stream, self.index, Purpose.MATERIALS)
            self.materials.append(material(kind, rng, self.colors, self.folder))
        return self.numbers[key]

    def textured(self, texture: Texture, owner: str, part: int) -> int:
        """Return the number of the material of a mesh's texture."""
        key = f"{owner} texture", part
        if key not in self.numbers:
            self.numbers[key] = len(self.materials)
            color, roughness, metallic, wrap = texture
            self.materials.append(Material(color, roughness, metallic=metallic, wrap=wrap))
        return self.numbers[key]

    def of_room(self) -> Array:
        """Return the numbers of the materials of a shell's parts."""
        kinds = room_kinds(self.seed, self.index)
        return np.array([self.number(kind, "room", i) for i, kind in enumerate(kinds)])

    def of_piece(self, name: str, thing: Furnishing) -> Array:
        """Return the numbers of the materials of a piece's parts."""
        return np.array([
            self.textured(thing.textures[i], name, i) if i < len(thing.textures)
            else self.number(kind, name, i) for i, kind in enumerate(thing.materials)
        ])  # fmt: skip

    def add(self, corners: Array, normals: Array, uv: Array, rows: Array) -> None:
        """Add triangles with the numbers of their materials."""
        self.parts.append((corners, normals, uv, rows))

    def shine(self, corners: Array, normals: Array, uv: Array, flux: float) -> None:
        """Add triangles that together shine with a flux, and reflect nothing."""
        rows = np.full(len(corners), len(self.materials))
        self.materials.append(glowing(corners, flux))
        self.add(corners, normals, uv, rows)


def area_of(corners: Array) -> float:
    """Return the area of triangles, (F, 3, 3)."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * float(np.sqrt((across**2).sum(axis=1)).sum())


def glowing(corners: Array, flux: float) -> Material:
    """Return the material of triangles, (F, 3, 3), that together shine with a flux."""
    radiance = np.array(WARM) * flux / (np.pi * max(area_of(corners), LEAST_GLOW))
    return Material(np.ones(3), 1.0, radiance=tuple(radiance.tolist()))


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
    collected = Collector(seed, index, folder)
    room = shell_of(shell_name(batch.interior[b]))
    flat = np.repeat(room.normals[:, None], 3, axis=1)
    rows = collected.of_room()
    shines = (room.part == PARTS.index(GLOW)) & lit
    collected.add(*(x[~shines] for x in (room.corners, flat, room.uv, rows[room.part])))
    if shines.any():
        glowing = room.corners[shines], flat[shines], room.uv[shines]
        collected.shine(*glowing, CEILING_FLUX)
    for k in range(int(batch.object_count[b])):
        name = batch.names[batch.shape[b, k]]
        made = batch.shape_of(name).furnished
        assert made is not None
        thing, vertices, _ = made
        placed, scale = batch.world_from_object[b, k], batch.object_scale[b, k]
        turned = placed[:3, :3]
        points = product(vertices, turned.T) + placed[:3, 3]
        normals = product(thing.corner_normals.reshape(-1, 3), turned.T / scale).reshape(-1, 3, 3)
        corners = points[thing.faces]
        rows = collected.of_piece(name, thing)
        glows = np.array([kind == GLOW for kind in thing.materials])[thing.part] & lit
        dark = ~glows
        collected.add(corners[dark], normals[dark], thing.corner_uv[dark], rows[thing.part[dark]])
        if glows.any():
            collected.shine(corners[glows], normals[glows], thing.corner_uv[glows], LAMP_FLUX)
    *soup, of_face = (np.concatenate(x) for x in zip(*collected.parts, strict=True))
    return Matter(Soup(*soup), tables_of(collected.materials, of_face))


def tables_of(materials: Sequence[Material], of_face: Array) -> Tables:
    """Return materials as tables; `of_face` is the number of each triangle's, (F,)."""
    rows = np.zeros((len(materials), 16), np.float32)
    maps: dict[int, tuple[Array, int]] = {}  # slopes and where they begin: patterns share them
    texels: list[Array] = []
    first_texel = first_slope = 0
    for row, one in zip(rows, materials, strict=True):
        texels.append(one.texels())
        row[:4] = first_texel, texels[-1].shape[1], texels[-1].shape[0], one.metres
        row[4:8] = one.metallic, one.specular, *one.wrap
        row[12:15] = one.radiance
        first_texel += _padded(texels[-1].size)
        if one.slopes is not None:
            if id(one.slopes) not in maps:
                maps[id(one.slopes)] = one.slopes, first_slope
                first_slope += _padded(one.slopes.size)
            start = maps[id(one.slopes)][1]
            factor = one.bumps / (one.metres * SLOPE_STEPS)
            row[8:12] = start, one.slopes.shape[1], one.slopes.shape[0], factor
    slopes = [values for values, _ in maps.values()] or [np.zeros((1, 1), np.uint32)]
    return Tables(of_face.astype(np.uint32), rows, _joined(texels), _joined(slopes))


def _padded(size: int) -> int:
    return -(-size // ALIGNED) * ALIGNED


def _joined(maps: Sequence[Array]) -> Array:
    """Return the values of maps in one row, each from a multiple of ALIGNED on."""
    values = np.zeros(sum(_padded(x.size) for x in maps), np.uint32)
    start = 0
    for x in maps:
        values[start : start + x.size] = x.ravel()
        start += _padded(x.size)
    return values

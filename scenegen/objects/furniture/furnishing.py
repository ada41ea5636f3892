"""Members of families as furniture: in metres, with texture coordinates, made of materials.

Frame: y up, standing on y = 0, centred in x and z, the front faces +z.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.objects.families.members import member_parts, member_rng
from scenegen.objects.families.parts.draws import pick, span
from scenegen.objects.families.parts.surfaces import Part, joined
from scenegen.objects.furniture.unwrapping import corner_uv
from scenegen.objects.solids import Array

WHOLE = ("picture", "screen", "dial", "rug", "leaf")  # materials whose map covers a piece once


@dataclass(frozen=True)
class Facts:
    """How large a family is, and what it is for.

    Attributes:
        height, width: least and greatest, in metres; the width is that along x. A width of None
            means that the builder works in metres; else the unit shape is scaled to the ranges.
        seats: whether people sit on it.
        surfaces: whether things stand on it.
    """

    height: tuple[float, float]
    width: tuple[float, float] | None = None
    seats: bool = False
    surfaces: bool = False


FAMILIES_FACTS = {
    "bowl": Facts((0.05, 0.12), (0.12, 0.3)),
    "mug": Facts((0.08, 0.13), (0.09, 0.15)),
    "bottle": Facts((0.2, 0.33), (0.06, 0.14)),
    "can": Facts((0.08, 0.18), (0.06, 0.14)),
    "lamp": Facts((0.32, 0.6), (0.15, 0.4)),
    "bag": Facts((0.25, 0.5), (0.2, 0.5)),
    "cap": Facts((0.1, 0.2), (0.17, 0.32)),
    "chair": Facts((0.78, 1.0), (0.42, 0.75), seats=True),
    "table": Facts((0.7, 0.77), (0.9, 1.8), surfaces=True),
    "sofa": Facts((0.68, 1.0), seats=True),
    "armchair": Facts((0.68, 1.0), seats=True),
    "stool": Facts((0.34, 0.78), seats=True),
    "shelf": Facts((0.6, 2.1), surfaces=True),
    "cabinet": Facts((0.55, 2.15), surfaces=True),
    "nightstand": Facts((0.4, 0.62), surfaces=True),
    "desk": Facts((0.71, 0.77), surfaces=True),
    "coffee_table": Facts((0.34, 0.48), surfaces=True),
    "bed": Facts((0.7, 1.2), seats=True),
    "cushion": Facts((0.25, 0.55)),
    "curtain": Facts((1.9, 2.4)),
    "rug": Facts((0.004, 0.02)),
    "plate": Facts((0.01, 0.07)),
    "cup": Facts((0.05, 0.1)),
    "vase": Facts((0.13, 0.9)),
    "basket": Facts((0.19, 0.46)),
    "book": Facts((0.009, 0.2)),
    "books": Facts((0.14, 0.31)),
    "box": Facts((0.1, 0.55)),
    "picture": Facts((0.15, 0.95)),
    "screen": Facts((0.35, 0.85)),
    "clock": Facts((0.22, 0.42)),
    "floor_lamp": Facts((1.4, 1.75), (0.32, 0.55)),
    "pendant": Facts((0.35, 1.0)),
    "plant": Facts((0.15, 0.65)),
    "tall_plant": Facts((0.55, 1.8)),
}
_CASE = {
    "case": ("wood", "paint"),
    "front": ("wood", "paint", "paint"),
    "handle": ("metal",),
    "feet": ("wood", "metal"),
}
# The materials of each role: of a part's name, or of all other parts (""). A part's name is a
# material where the table lacks it; what follows a space tells materials of one kind apart.
_ROLES: dict[str, dict[str, tuple[str, ...]]] = {
    "bowl": {"": ("ceramic", "ceramic", "wood", "metal", "plastic")},
    "mug": {"": ("ceramic",)},
    "bottle": {"": ("bottle", "bottle", "ceramic", "plastic"), "closure": ("metal", "plastic")},
    "can": {"": ("print", "metal")},
    "lamp": {
        "": ("metal", "metal", "paint"),
        "body": ("ceramic", "ceramic", "wood", "terracotta"),
        "shade": ("glow",),
    },
    "bag": {"": ("fabric", "leather"), "strap": ("leather",)},
    "cap": {"": ("fabric", "felt")},
    "chair": {
        "seat": ("wood", "wood", "fabric", "leather", "plastic"),
        "back": ("wood",),
        "legs": ("wood", "wood", "metal"),
        "tub": ("fabric", "leather"),
    },
    "table": {
        "top": ("wood", "wood", "wood", "wood", "stone", "paint"),
        "legs": ("wood", "wood", "wood", "paint", "metal"),
    },
    "sofa": {"cover": ("fabric", "fabric", "leather"), "feet": ("wood", "metal")},
    "armchair": {"cover": ("fabric", "fabric", "leather"), "feet": ("wood", "metal")},
    "stool": {
        "seat": ("wood", "wood", "plastic"),
        "cover": ("fabric", "leather"),
        "legs": ("wood", "wood", "metal"),
    },
    "shelf": {"board": ("wood", "wood", "paint"), "back": ("wood", "paint")},
    "cabinet": _CASE,
    "nightstand": _CASE,
    "desk": {
        "top": ("wood", "wood", "paint"),
        "case": ("paint", "wood"),
        "front": ("paint", "wood"),
        "handle": ("metal",),
        "legs": ("wood", "metal"),
    },
    "coffee_table": {"top": ("wood", "wood", "stone"), "legs": ("wood", "metal")},
    "bed": {
        "frame": ("wood", "wood", "paint"),
        "cover": ("fabric", "leather"),
        "sheet": ("linen",),
        "blanket": ("linen", "fabric", "fabric", "printed"),
        "throw": ("fabric", "printed"),
    },
    "cushion": {"": ("fabric", "printed", "printed")},
    "curtain": {"cloth": ("linen", "linen", "fabric"), "rail": ("metal",)},
    "rug": {"": ("rug",)},
    "plate": {"": ("ceramic",)},
    "cup": {"": ("ceramic",), "drink": ("drink",)},
    "vase": {"": ("ceramic", "ceramic", "terracotta"), "stem": ("stem",)},
    "basket": {"": ("wicker",)},
    "book": {"pages": ("paper",)},
    "books": {"pages": ("paper",)},
    "box": {
        "card": ("cardboard",),
        "tape": ("plastic",),
        "slats": ("wood",),
        "body": ("cardboard", "print", "felt"),
        "lid": ("cardboard", "print", "felt"),
    },
    "picture": {"frame": ("wood", "paint", "metal"), "mount": ("paper",)},
    "screen": {"case": ("black",), "stand": ("black",)},
    "clock": {"rim": ("wood", "metal", "black"), "hand": ("black",)},
    "floor_lamp": {"": ("wood", "metal", "metal"), "shade": ("glow",)},
    "pendant": {
        "metal": ("metal",),
        "shade": ("glow",),
        "metal shade": ("paint", "metal", "plastic"),
    },
    "plant": {"pot": ("ceramic", "terracotta", "wicker")},
    "tall_plant": {"pot": ("ceramic", "terracotta", "wicker"), "trunk": ("stem",)},
}
_SHARED = ("wood", "metal", "paint", "glow", "leather")  # all parts of an object are of the same
_PLAIN = ("wood", "plastic", "ceramic", "paint")  # of meshes that tell none


REPEAT, CLAMP, MIRROR = range(3)  # how a picture goes on beyond its edges


class Texture(NamedTuple):
    """A picture on a surface: linear RGB, 0 to 1, (H, W, 3) float32, row 0 at v = 0.

    `wrap` tells how it goes on along u and v.
    """

    color: Array
    roughness: float
    metallic: float
    wrap: tuple[int, ...] = (REPEAT, REPEAT)


class Paint(NamedTuple):
    """What the faces of a mesh look like: textures, which of them (F,), and where (F, 3, 2)."""

    textures: tuple[Texture, ...]
    texture: Array
    uv: Array


@dataclass(frozen=True, eq=False)
class Furnishing:
    """A member of a family as a thing in a room, or a mesh that takes the place of one.

    Attributes:
        family, number: which member; a mesh has the number MESH.
        vertices: in metres, (V, 3) float64.
        faces: three vertices of each triangle, (F, 3), counter-clockwise seen from outside; the
            parts are closed surfaces. Neither need hold of a mesh.
        corner_uv: texture coordinates of the corners, (F, 3, 2), in metres; from 0 to 1 for
            materials in `WHOLE` and textures.
        corner_normals: unit normals of the smooth surface at the corners, (F, 3, 3).
        part: the index into `materials`, (F,) int16.
        patch: the number of the closed surface that a face belongs to, (F,) int32.
        materials: kinds of materials, as of `rendering.materials`. A kind occurs twice where two
            parts are of different materials of the same kind.
        textures: those of a mesh, which its first materials stand for.
    """

    family: str
    number: int
    vertices: Array
    faces: Array
    corner_uv: Array
    corner_normals: Array
    part: Array
    patch: Array
    materials: tuple[str, ...]
    textures: tuple[Texture, ...] = ()


def furnishing(family: str, number: int) -> Furnishing:
    """Return a family's member as furniture. Raises SpecError as `members.check_member`."""
    rng = member_rng(family, number, 1)
    parts = member_parts(family, number)
    scale = _scale(family, parts, rng)
    kinds, index = _materials(family, [part.material for part in parts], rng)
    meshes, uv, normals = [], [], []
    for part, i in zip(parts, index, strict=True):
        vertices = part.vertices * scale
        smooth = part.normals / scale
        smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
        meshes.append((vertices, part.faces, smooth))
        normals.append(smooth[part.faces])
        uv.append(corner_uv(part, vertices, whole=kinds[i] in WHOLE))
    vertices, faces, _ = joined(meshes)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices -= [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]
    vertices = rounded(vertices, POINT_STEP)  # cosines differ in their last bits between machines
    counts = [len(part.faces) for part in parts]
    pieces = [part.pieces for part in parts]
    sizes = np.repeat(np.divide(counts, pieces).astype(int), pieces)
    return Furnishing(
        family,
        number,
        vertices,
        faces,
        corner_uv=np.concatenate(uv),
        corner_normals=np.concatenate(normals),
        part=np.repeat(np.array(index, np.int16), counts),
        patch=np.repeat(np.arange(len(sizes), dtype=np.int32), sizes),
        materials=kinds,
    )


def _scale(family: str, parts: list[Part], rng: np.random.Generator) -> Array:
    """Return the factors from the builder's units to metres, (3,); those of x and z are equal.

    A member keeps its proportions as far as the ranges of height and width allow.
    """
    facts = FAMILIES_FACTS[family]
    height = span(rng, *facts.height)
    if facts.width is None:
        return np.ones(3)
    extent = np.ptp(np.concatenate([part.vertices for part in parts]), axis=0)
    up = height / float(extent[1])
    wide = min(max(up * float(extent[0]), facts.width[0]), facts.width[1])
    sideways = wide / float(extent[0])
    return np.array([sideways, up, sideways])


def _materials(
    family: str, names: list[str], rng: np.random.Generator
) -> tuple[tuple[str, ...], list[int]]:
    """Return the kinds of a member's materials, and the index of each part's."""
    roles, number_of = _ROLES.get(family, {}), dict[str, int]()
    kinds: list[str] = []
    for name in dict.fromkeys(names):
        kind = pick(rng, roles.get(name, (name.split()[0] if name else name,)))
        if kind in _SHARED and kind in kinds:
            number_of[name] = kinds.index(kind)
            continue
        number_of[name] = len(kinds)
        kinds.append(kind)
    return tuple(kinds), [number_of[name] for name in names]


def whole_kind(family: str, share: float) -> str:
    """Return a kind of material for a whole mesh in the place of a family, by a share of 1."""
    roles = _ROLES.get(family, {})
    kinds = next((kinds for kinds in roles.values() if "glow" not in kinds), _PLAIN)
    return kinds[int(share * len(kinds))]


Rectangle = tuple[float, float, float, float, float]
MESH = -1
CLEAR = 0.12  # metres of free height above a support
LEAST_SIDE = 0.08  # metres, of a support
_AT_ONCE = 10_000  # triangles, to take little memory
_GRID = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 9)]), axis=-1).reshape(-1, 2)


def supports(thing: Furnishing) -> list[Rectangle]:
    """Return horizontal rectangles (y, x0, x1, z0, z1) on which things can stand, in metres.

    They lie on tops, boards and seats, with at least CLEAR of free height above them. The lowest
    come first. There are none on a thing whose family has neither surfaces nor seats.
    """
    facts = FAMILIES_FACTS.get(thing.family)
    if facts is None or not (facts.surfaces or facts.seats):
        return []
    corners = thing.vertices[thing.faces]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(a, b)
    # The faces of a mesh may look to either side.
    up = (normal[:, 1] > 0.0) | (thing.number == MESH)
    level = (np.ptp(corners[..., 1], axis=1) < 1e-6) & up
    patches = thing.patch[level]
    heights = np.round(corners[level, 0, 1], 4)
    found: list[Rectangle] = []
    for patch, y in sorted({*zip(patches.tolist(), heights.tolist(), strict=True)}):
        points = corners[level][(patches == patch) & (heights == y)].reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        if (high - low)[::2].min() <= LEAST_SIDE:
            continue
        middle, half, top = (low + high)[::2] / 2, (high - low)[::2] / 2, float(points[0, 1])
        for share in (0.97, 0.85, 0.7, 0.55):
            if not _is_on(corners, middle + share * half * _GRID, top):
                continue
            first, last = _free(corners, middle - share * half, middle + share * half, top)
            if (last - first).min() > LEAST_SIDE:
                (x0, z0), (x1, z1) = first.tolist(), last.tolist()
                found.append((top, x0, x1, z0, z1))
            break
    return sorted(found)


def _is_on(corners: Array, places: Array, y: float) -> bool:
    """Return whether all places (x, z), (P, 2), are on a horizontal surface at y."""
    level = corners[np.abs(corners[..., 1] - y).max(axis=1) < 1e-6][..., ::2]
    parts = (level[i : i + _AT_ONCE] for i in range(0, len(level), _AT_ONCE))
    return bool(np.any([_inside(part, places) for part in parts], axis=0).all())


def _inside(triangles: Array, places: Array) -> Array:
    """Return which places, (P, 2), are in one of the triangles, (F, 3, 2)."""
    a, b, c = triangles.swapaxes(0, 1)

    def side(p: Array, q: Array) -> Array:
        """Return on which side of the lines p-q the places lie, seen from above, (F, P)."""
        ahead, across = q - p, places[None] - p[:, None]
        return np.asarray(ahead[:, :1] * across[..., 1] - ahead[:, 1:] * across[..., 0])

    u, v, w = side(b, c), side(c, a), side(a, b)
    inside = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    return np.asarray(inside.any(axis=0))


def _free(corners: Array, first: Array, last: Array, y: float) -> tuple[Array, Array]:
    """Cut a rectangle (x, z) until no triangle's box is above it within CLEAR; keep most area."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    near = (high[:, 1] > y + 1e-4) & (low[:, 1] < y + CLEAR)
    low, high = low[near][:, ::2], high[near][:, ::2]
    while (last > first).all():
        above = ((low < last - 1e-9) & (high > first + 1e-9)).all(axis=1)
        if not above.any():
            break
        k = int(np.argmax(above))
        cuts = []
        for axis in (0, 1):
            for start, end in ((high[k, axis], last[axis]), (first[axis], low[k, axis])):
                a, b = first.copy(), last.copy()
                a[axis], b[axis] = start, end
                cuts.append((float(np.prod(np.maximum(b - a, 0.0))), a, b))
        _, first, last = max(cuts, key=lambda cut: cut[0])
    return first, last

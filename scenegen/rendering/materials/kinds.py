"""Materials by kind, drawn from a stream of random numbers and the palette of a room."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.random import Generator

from scenegen.common.names import check_choice
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.rendering.materials import patterns, pictures
from scenegen.rendering.materials.folders import MapFiles, read_maps
from scenegen.rendering.materials.material import Array, Material, lerp
from scenegen.rendering.materials.palettes import Color, Palette, linear
from scenegen.rendering.materials.patterns import Pattern

VARIANTS = 6  # of each pattern; colours make more of them


def material(
    kind: str,
    rng: Generator,
    palette: Palette,
    folder: Mapping[str, tuple[MapFiles, ...]] | None = None,
) -> Material:
    """Return a material of a kind: drawn, or one from a folder where that has some of the kind.

    Args:
        folder: as from `folders.from_folder`.

    Raises:
        SpecError: the kind is not in KINDS.
        FileFormatError: a map of the folder cannot be read.
    """
    check_choice("material", kind, KINDS)
    if folder and kind in folder:
        return read_maps(pick(rng, folder[kind]))
    return _DRAWN[kind](rng, palette)


def _seed(rng: Generator) -> int:
    return int(rng.random() * VARIANTS)


def _scaled(color: Color, factor: float) -> Array:
    return np.minimum(factor * np.array(color), 0.88)


def _two_tone(
    pattern: Pattern, dark: Array, light: Array, *, seam: Color | None = None,
    rough: tuple[float, float] = (0.5, 0.5), rough_seam: float = 0.9,
    metres: float, specular: float = 0.5, bumps: float = 1.0,
) -> Material:  # fmt: skip
    """Colour a pattern: shares between two colours, and joints in a third.

    Args:
        rough: where the share is 0 and where it is 1; `rough_seam` in the seams, if coloured.
        bumps: factor of the pattern's heights.
    """
    share, joint = pattern.share, pattern.seam
    color = lerp(dark, light, share)
    roughness = rough[0] + (rough[1] - rough[0]) * share
    if seam is not None:
        color += joint[..., None] * (np.asarray(seam, np.float32) - color)
        roughness = roughness + joint * (rough_seam - roughness)
    height = bumps * pattern.height if bumps and pattern.height.any() else None
    return Material(
        color, roughness.astype(np.float32), height, specular=specular, metres=metres
    )


# Rooms.


def _floor(rng: Generator, palette: Palette) -> Material:
    styles = (_boards, _boards, _boards, _blocks, _tiled, _tiled, _carpet, _marble)
    return pick(rng, styles)(rng, palette)


def _boards(rng: Generator, palette: Palette) -> Material:
    pattern = patterns.planks(int(3 * rng.random()), pick(rng, (8, 10, 12)))
    return _planked(rng, pattern, palette, 1.6)


def _blocks(rng: Generator, palette: Palette) -> Material:
    ratio = pick(rng, (4, 5, 6))
    return _planked(rng, patterns.herringbone(int(3 * rng.random()), ratio), palette, 0.14 * ratio)


def _planked(rng: Generator, pattern: Pattern, palette: Palette, metres: float) -> Material:
    dark, light = (np.array(color) for color in palette.woods[0])
    rough = span(rng, 0.25, 0.5)
    joint = tuple(float(c) for c in 0.25 * dark)
    return _two_tone(
        pattern, dark, light, seam=(joint[0], joint[1], joint[2]),
        rough=(rough + 0.15, rough), metres=metres,
    )  # fmt: skip


def _tiled(rng: Generator, palette: Palette) -> Material:
    columns, rows, metres, running = pick(
        rng, ((4, 4, 1.2, False), (2, 2, 1.2, False), (2, 4, 1.6, True), (8, 8, 1.2, False))
    )
    base = pick(rng, (palette.neutrals[1], palette.neutrals[2], palette.walls[1], palette.neutrals[3]))
    rough = span(rng, 0.1, 0.4)
    grout = linear(pick(rng, ("c9c4bb", "8f8b84", "6a6762")))
    pattern = patterns.tiles(_seed(rng), columns, rows, running)
    return _two_tone(
        pattern, _scaled(base, 0.8), _scaled(base, 1.08), seam=grout,
        rough=(rough + 0.08, rough), metres=metres,
    )  # fmt: skip


def _carpet(rng: Generator, palette: Palette) -> Material:
    base = pick(rng, (palette.neutrals[1], palette.neutrals[2], palette.fabrics[1], palette.fabrics[3]))
    pattern = patterns.pile(_seed(rng))
    return _two_tone(
        pattern, _scaled(base, 0.5), _scaled(base, 0.95), rough=(1.0, 0.95), metres=0.5, specular=0.05
    )


def _wall(index: int) -> Callable[[Generator, Palette], Material]:
    """Return the drawing of the first or the second colour of the walls."""

    def draw(rng: Generator, palette: Palette) -> Material:
        color = palette.walls[index]
        style = pick(rng, ("paint", "paint", "paint", "paint", "plaster", "paper"))
        if style == "plaster":
            pattern = patterns.trowel(_seed(rng))
            return _two_tone(
                pattern, _scaled(color, 0.87), _scaled(color, 1.03), rough=(0.95, 0.85),
                metres=2.0, specular=0.2,
            )  # fmt: skip
        if style == "paper":
            kind = pick(rng, ("stripes", "pin", "sprigs", "diamonds", "sprigs"))
            figure = patterns.stripes(kind, pick(rng, (4, 5)), _seed(rng))
            other = _scaled(color, pick(rng, (0.82, 0.9, 1.08)))
            return Material(lerp(color, other, figure), 0.75, specular=0.3, metres=0.75)
        pattern = patterns.roller(_seed(rng))
        rough = span(rng, 0.6, 0.95)
        return _two_tone(
            pattern, _scaled(color, 0.95), _scaled(color, 1.02), rough=(rough + 0.04, rough),
            metres=1.0, specular=0.3,
        )  # fmt: skip

    return draw


def _ceiling(rng: Generator, palette: Palette) -> Material:
    pattern = patterns.roller(_seed(rng))
    color = palette.ceiling
    dark, light = _scaled(color, 0.97), _scaled(color, 1.0)
    return _two_tone(pattern, dark, light, rough=(0.95, 0.9), metres=1.5, specular=0.2)


def _trim(rng: Generator, palette: Palette) -> Material:
    return Material(np.array(palette.trim), span(rng, 0.3, 0.5))


def _door(rng: Generator, palette: Palette) -> Material:
    return _wood(rng, palette) if chance(rng, 0.3) else _trim(rng, palette)


def _sill(rng: Generator, palette: Palette) -> Material:
    return pick(rng, (_trim, _trim, _marble, _wood))(rng, palette)


# Furniture.


def _wood(rng: Generator, palette: Palette) -> Material:
    share = np.roll(patterns.grain(_seed(rng)), int(rng.random() * patterns.SIZE), axis=1)
    dark, light = palette.woods[1]
    rough = span(rng, 0.28, 0.5)
    roughness = (rough + 0.14 * (1.0 - share)).astype(np.float32)
    return Material(lerp(dark, light, share), roughness, 0.00006 * share, metres=0.6)


def _paint(rng: Generator, palette: Palette) -> Material:
    """Draw lacquer: mostly white or neutral, sometimes a colour of the room."""
    white, grey, dark = palette.neutrals[0], palette.neutrals[1], palette.neutrals[3]
    colors = (palette.fabrics[2], palette.accents[1])
    color = pick(rng, (white, white, white, grey, dark, *colors, palette.fabrics[1]))
    pattern = patterns.roller(_seed(rng))
    rough = span(rng, 0.25, 0.5)
    dark, light = _scaled(color, 0.97), _scaled(color, 1.0)
    return _two_tone(pattern, dark, light, rough=(rough + 0.08, rough), metres=0.6, bumps=0.3)


def _marble(rng: Generator, palette: Palette) -> Material:
    stone, vein = pick(
        rng, (("eeebe6", "8d8a86"), ("e6dccb", "a98f6c"), ("2b2c2e", "b9b4ab"), ("8f928f", "d8d6d0"))
    )
    if chance(rng, 0.35):  # granite
        pattern = patterns.speckles(_seed(rng), 110)
    else:
        pattern = patterns.marble(_seed(rng))
    base, rough = linear(stone), span(rng, 0.08, 0.3)
    return _two_tone(
        pattern, _scaled(base, 0.82), _scaled(base, 1.05), seam=linear(vein),
        rough=(rough, rough + 0.05), rough_seam=rough + 0.1, metres=0.9,
    )  # fmt: skip


def _metal(rng: Generator, palette: Palette) -> Material:
    brushed = patterns.weave(0, 64, "plain").share  # any fine field does
    rough = span(rng, 0.12, 0.4)
    maps = (rough + 0.05 * (brushed - 0.5)).astype(np.float32)
    return Material(np.array(palette.metal), maps, metallic=1.0, metres=0.1)


def _leather(rng: Generator, palette: Palette) -> Material:
    tans = tuple(linear(name) for name in ("5a3a26", "8a5a34", "2b2522", "a98a66", "6b2f22"))
    color = pick(rng, (*tans, palette.fabrics[2]))
    rough = span(rng, 0.35, 0.55)
    return _two_tone(
        patterns.hide(_seed(rng)), _scaled(color, 0.55), _scaled(color, 1.1),
        rough=(rough + 0.2, rough), metres=0.4,
    )  # fmt: skip


def _cloth(
    rng: Generator, color: Color, other: Color | None, style: str, threads: int, metres: float
) -> Material:
    """Weave a cloth of one colour, or print or weave a figure of another colour into it."""
    pattern = patterns.weave(_seed(rng), threads, style)
    base = np.asarray(color, np.float32)
    if other is not None:
        kind = pick(rng, ("stripes", "pin", "checks", "dots", "zigzag", "diamonds", "sprigs"))
        count = pick(rng, (6, 8, 10)) if kind == "dots" else pick(rng, (3, 4, 5))
        figure = patterns.stripes(kind, count, _seed(rng))
        base = lerp(color, other, figure)
    light = np.minimum((0.45 + 0.75 * pattern.share)[..., None] * base, 0.9)
    return Material(light, 0.95, pattern.height, specular=0.1, metres=metres)


def _fabric(rng: Generator, palette: Palette) -> Material:
    color = pick(rng, (*palette.fabrics, palette.fabrics[0]))
    other = None
    if chance(rng, 0.35):
        other = pick(rng, tuple(c for c in (*palette.fabrics, *palette.accents) if c != color))
    style = pick(rng, ("plain", "twill", "basket"))
    metres = 0.4 if other else 0.2
    return _cloth(rng, color, other, style, 128 if other else 64, metres)


def _linen(rng: Generator, palette: Palette) -> Material:
    """Draw thin cloth in quiet colours, of sheets and curtains."""
    color = pick(rng, (palette.neutrals[0], palette.neutrals[0], palette.fabrics[1], palette.walls[0]))
    other = palette.fabrics[0] if chance(rng, 0.15) else None
    return _cloth(rng, color, other, "plain", 160, 0.35)


def _felt(rng: Generator, palette: Palette) -> Material:
    color = pick(rng, palette.fabrics)
    dark, light = _scaled(color, 0.75), _scaled(color, 1.05)
    pattern = patterns.pile(_seed(rng))
    return _two_tone(pattern, dark, light, rough=(1.0, 0.95), metres=0.3, specular=0.05, bumps=0.3)


def _rug(rng: Generator, palette: Palette) -> Material:
    colors = (*palette.fabrics[1:], *palette.accents)
    return pictures.rug(rng, palette.fabrics[0], colors, patterns.pile(_seed(rng)))


def _wicker(rng: Generator, palette: Palette) -> Material:
    pattern = patterns.wickerwork(int(3 * rng.random()))
    dark, light = (np.array(c) for c in pick(rng, palette.woods))
    return _two_tone(pattern, 0.35 * dark, 1.1 * light, rough=(0.8, 0.6), metres=0.16)


# Small things.


def _ceramic(rng: Generator, palette: Palette) -> Material:
    """Draw glaze: white, coloured, or stoneware with speckles."""
    white = palette.neutrals[0]
    color = pick(rng, (white, white, palette.neutrals[3], *palette.accents))
    rough = span(rng, 0.06, 0.3)
    stoneware = chance(rng, 0.35)
    pattern = patterns.speckles(_seed(rng), pick(rng, (80, 160)))
    dark, light = _scaled(color, 0.86), _scaled(color, 1.0)
    speck = linear("5a4632") if stoneware else None
    return _two_tone(
        pattern, dark, light, seam=speck, rough=(rough + 0.05, rough), rough_seam=0.5, metres=0.4
    )


def _terracotta(rng: Generator, palette: Palette) -> Material:
    color = pick(rng, (linear("b5623f"), linear("a9583a"), linear("c9a48a"), palette.neutrals[2]))
    pattern = patterns.trowel(_seed(rng))
    dark, light = _scaled(color, 0.75), _scaled(color, 1.1)
    return _two_tone(pattern, dark, light, rough=(0.95, 0.85), metres=0.8, specular=0.1, bumps=0.2)


def _plastic(rng: Generator, palette: Palette) -> Material:
    color = pick(rng, (palette.neutrals[0], palette.neutrals[4], *palette.accents))
    return Material(np.array(color), span(rng, 0.2, 0.5))


def _bottle(rng: Generator, palette: Palette) -> Material:
    """Draw glass so dark or full that nothing shows through it."""
    del palette
    color = linear(pick(rng, ("16261a", "1f3a22", "3a1e0e", "141416", "5a1f1c", "c9d2cc")))
    return Material(np.array(color), span(rng, 0.04, 0.12), specular=0.6)


def _black(rng: Generator, palette: Palette) -> Material:
    return Material(np.array(palette.neutrals[4]), span(rng, 0.3, 0.5))


def _cardboard(rng: Generator, palette: Palette) -> Material:
    del palette
    color = linear(pick(rng, ("b48a5e", "a97f55", "c29c72")))
    pattern = patterns.roller(_seed(rng))
    dark, light = _scaled(color, 0.85), _scaled(color, 1.05)
    return _two_tone(pattern, dark, light, rough=(0.9, 0.85), metres=0.5, specular=0.15)


def _mount(rng: Generator, palette: Palette) -> Material:
    color = pick(rng, (palette.neutrals[0], palette.neutrals[0], linear("efe8d8")))
    return Material(np.array(color), 0.9, specular=0.1)


def _pages(rng: Generator, palette: Palette) -> Material:
    """Draw the edges of pages: lines along v."""
    del palette
    lines = np.random.default_rng(_seed(rng)).random(patterns.SIZE, np.float32)
    share = np.broadcast_to(lines, (patterns.SIZE, patterns.SIZE))
    color = linear(pick(rng, ("ece4d0", "e3d8bf", "f0ece2")))
    return Material(lerp(_scaled(color, 0.7), color, share), 0.95, specular=0.1, metres=0.2)


def _print(rng: Generator, palette: Palette) -> Material:
    """Draw printed card, of book covers and boxes: one colour with bands of another."""
    options = (*palette.accents, *palette.fabrics, palette.neutrals[0], palette.neutrals[4])
    color, other = pick(rng, options), pick(rng, options)
    return pictures.bands(rng, color, other, span(rng, 0.3, 0.6))


def _leaf(rng: Generator, palette: Palette) -> Material:
    del palette
    return pictures.leaf(rng)


def _stem(rng: Generator, palette: Palette) -> Material:
    del palette
    return Material(np.array(linear(pick(rng, ("5f6b3a", "6b5a3c", "4f6034", "8a7550")))), 0.7)


def _soil(rng: Generator, palette: Palette) -> Material:
    del palette
    pattern = patterns.pile(_seed(rng))
    dark, light = np.array(linear("1c1511")), np.array(linear("4a392c"))
    return _two_tone(pattern, dark, light, rough=(1.0, 0.95), metres=0.25, specular=0.05, bumps=2.0)


def _glow(rng: Generator, palette: Palette) -> Material:
    """Draw the cloth of a lamp shade."""
    del palette
    return _cloth(rng, linear(pick(rng, ("f3ece0", "efe2c8", "f5f3ee"))), None, "plain", 160, 0.3)


def _drink(rng: Generator, palette: Palette) -> Material:
    del palette
    return Material(np.array(linear(pick(rng, ("2a160c", "6b4a30", "7a3f14")))), 0.05)


_DRAWN: dict[str, Callable[[Generator, Palette], Material]] = {
    "floor": _floor, "wall": _wall(0), "accent": _wall(1), "ceiling": _ceiling,
    "skirting": _trim, "door": _door, "frame": _trim, "sill": _sill,
    "wood": _wood, "paint": _paint, "stone": _marble, "metal": _metal,
    "fabric": _fabric, "linen": _linen, "felt": _felt, "leather": _leather, "rug": _rug,
    "wicker": _wicker, "ceramic": _ceramic, "terracotta": _terracotta, "plastic": _plastic,
    "black": _black, "bottle": _bottle, "cardboard": _cardboard, "paper": _mount, "pages": _pages, "print": _print,
    "leaf": _leaf, "stem": _stem, "soil": _soil, "glow": _glow, "drink": _drink,
    "picture": pictures.picture, "screen": pictures.screen, "dial": pictures.dial,
}  # fmt: skip
KINDS = tuple(_DRAWN)

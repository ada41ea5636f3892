"""Materials by kind, drawn from a stream of random numbers and the palette of a room."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.random import Generator

from scenegen.common.names import check_choice
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.rendering.materials import patterns, pictures
from scenegen.rendering.materials.folders import MapFiles, read_maps
from scenegen.rendering.materials.material import Array, Material, lerp
from scenegen.rendering.materials.palettes import Color, Palette, linear
from scenegen.rendering.materials.patterns import SEAMS, Pattern

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
    draw = _DRAWN.get(kind)
    return draw(rng, palette) if draw else _painted(pick(rng, _RECIPES[kind]), rng, palette)


@dataclass(frozen=True)
class Recipe:
    """A surface of one colour, or of shades of it in a pattern.

    Attributes:
        colors: to choose from: "neutrals0" is the first of the palette's neutrals, "accents" all
            of its accents, "trim" the colour of that name, "5a3a26" a colour of its own.
        rough: least and greatest roughness.
        pattern: of the shades; None for one colour.
        shades: factors of the colour where the pattern's share is 0 and where it is 1.
        rougher: by how much it is rougher where the share is 0.
        seam: colour of the pattern's seams, to choose from; none if empty.
        rough_seam: roughness of the seams.
        bumps: factor of the pattern's heights.
        metres, specular: as of `Material`.
        every: pixel of the pattern that is kept; 2 where things are small or a wall is smooth.
    """

    colors: str
    rough: tuple[float, float]
    pattern: Callable[[int], Pattern] | None = None
    shades: tuple[float, float] = (0.95, 1.02)
    rougher: float = 0.05
    seam: str = ""
    rough_seam: float = 0.5
    bumps: float = 1.0
    metres: float = 1.0
    specular: float = 0.5
    every: int = 1


def _granite(seed: int) -> Pattern:
    return patterns.speckles(seed, 110)


def _tile(columns: int, rows: int) -> Callable[[int], Pattern]:
    return lambda seed: patterns.tiles(seed, columns, rows)


_GLAZE = "neutrals0 neutrals0 neutrals0 neutrals3 accents"
_GROUT = "c9c4bb 8f8b84 6a6762"
_QUIET = "neutrals1 neutrals2 walls1 neutrals3"
_TRIM = (Recipe("trim", (0.3, 0.5)),)
_MARBLES = (("eeebe6", "8d8a86"), ("e6dccb", "a98f6c"), ("2b2c2e", "b9b4ab"), ("8f928f", "d8d6d0"))
_STONES = tuple(
    Recipe(stone, (0.08, 0.3), pattern, (0.82, 1.05), seam=vein, rough_seam=0.3, metres=0.9)
    for pattern in (patterns.marble, patterns.marble, _granite)
    for stone, vein in _MARBLES
)
_TILES = tuple(
    Recipe(_QUIET, (0.1, 0.4), _tile(across, along), (0.8, 1.08), 0.08, _GROUT, 0.9, metres=metres)
    for across, along, metres in ((4, 4, 1.2), (2, 2, 1.2), (2, 4, 1.6), (8, 8, 1.2))
)
_CARPET = Recipe(
    "neutrals1 neutrals2 fabrics1 fabrics3", (0.95, 0.95), patterns.pile, (0.5, 0.95),
    metres=0.5, specular=0.05,
)  # fmt: skip
# fmt: off
_RECIPES: dict[str, tuple[Recipe, ...]] = {
    "ceiling": (
        Recipe("ceiling", (0.9, 0.95), patterns.roller, (0.97, 1.0), metres=1.5, specular=0.2),
    ),
    "skirting": _TRIM,
    "frame": _TRIM,
    "stone": _STONES,
    "paint": (
        Recipe("neutrals0 neutrals0 neutrals0 neutrals1 neutrals3 fabrics1 fabrics2 accents1",
               (0.25, 0.5), patterns.roller, (0.97, 1.0), 0.08, bumps=0.3, metres=0.6, every=2),
    ),
    "leather": (
        Recipe("5a3a26 8a5a34 2b2522 a98a66 6b2f22 fabrics2", (0.35, 0.5), patterns.hide,
               (0.55, 1.1), 0.2, metres=0.4),
    ),
    "felt": (
        Recipe("fabrics", (0.95, 0.95), patterns.pile, (0.75, 1.05), bumps=0.3, metres=0.3,
               specular=0.05),
    ),
    "ceramic": (
        Recipe(_GLAZE, (0.06, 0.3), lambda s: patterns.speckles(s, 80), (0.86, 1.0), metres=0.4,
               every=2),
        Recipe(_GLAZE, (0.06, 0.3), lambda s: patterns.speckles(s, 40), (0.9, 1.0), metres=0.4,
               every=2),
        Recipe(_GLAZE, (0.15, 0.4), lambda s: patterns.speckles(s, 160), (0.86, 1.0),
               seam="5a4632", metres=0.4, every=2),
    ),
    "terracotta": (
        Recipe("b5623f a9583a c9a48a neutrals2", (0.85, 0.9), patterns.trowel, (0.75, 1.1),
               bumps=0.2, metres=0.8, specular=0.1, every=2),
    ),
    "cardboard": (
        Recipe("b48a5e a97f55 c29c72", (0.85, 0.9), patterns.roller, (0.85, 1.05), metres=0.5,
               specular=0.15, every=2),
    ),
    "soil": (
        Recipe("3a2c22", (0.95, 0.95), patterns.pile, (0.3, 1.3), bumps=0.5, metres=0.25,
               specular=0.05, every=2),
    ),
    "plastic": (Recipe("neutrals0 neutrals4 accents", (0.2, 0.5)),),
    "black": (Recipe("neutrals4", (0.3, 0.5)),),
    # Glass so dark or so full that nothing shows through it.
    "bottle": (Recipe("16261a 1f3a22 3a1e0e 141416 5a1f1c c9d2cc", (0.05, 0.12), specular=0.6),),
    "paper": (Recipe("neutrals0 neutrals0 efe8d8", (0.9, 0.9), specular=0.1),),
    "stem": (Recipe("5f6b3a 6b5a3c 4f6034 8a7550", (0.7, 0.7)),),
    "drink": (Recipe("2a160c 6b4a30 7a3f14", (0.05, 0.05)),),
}
# fmt: on


def _painted(recipe: Recipe, rng: Generator, palette: Palette) -> Material:
    color, rough = pick(rng, _options(recipe.colors, palette)), span(rng, *recipe.rough)
    if recipe.pattern is None:
        return Material(np.array(color), rough, specular=recipe.specular)
    dark, light = (np.minimum(factor * np.array(color), 0.88) for factor in recipe.shades)
    return _shaded(recipe, recipe.pattern(_seed(rng)), dark, light, rough, rng, palette)


def _shaded(
    recipe: Recipe, pattern: Pattern, dark: Array, light: Array, rough: float, rng: Generator,
    palette: Palette,
) -> Material:  # fmt: skip
    """Colour a pattern from dark to light, and its seams in their own colour."""
    share, joint = patterns.levels()
    color, roughness = lerp(dark, light, share), rough + recipe.rougher * (1.0 - share)
    if recipe.seam:
        seam = np.asarray(pick(rng, _options(recipe.seam, palette)), np.float32)
        color += joint[:, None] * (seam - color)
        roughness = roughness + joint * (recipe.rough_seam - roughness)
    index, slopes = (
        None if values is None else values[:: recipe.every, :: recipe.every] for values in pattern
    )
    return Material(
        color, np.clip(roughness, 0.05, 1.0), index, slopes, recipe.bumps,
        specular=recipe.specular, metres=recipe.metres,
    )  # fmt: skip


def _options(names: str, palette: Palette) -> tuple[Color, ...]:
    """Return the colours that `Recipe.colors` names."""
    known: dict[str, Any] = {f.name: getattr(palette, f.name) for f in fields(palette)}
    options: list[Color] = []
    for name in names.split():
        own = known.get(name.rstrip("01234"))
        if own is None:
            options.append(linear(name))
        elif name[-1].isdigit():
            options.append(own[int(name[-1])])
        else:
            options += own if isinstance(own[0], tuple) else [own]
    return tuple(options)


def _seed(rng: Generator) -> int:
    return int(rng.random() * VARIANTS)


def _recipes(*recipes: Recipe) -> Callable[[Generator, Palette], Material]:
    return lambda rng, palette: _painted(pick(rng, recipes), rng, palette)


def _floor(rng: Generator, palette: Palette) -> Material:
    styles = (_boards, _boards, _boards, _blocks, _recipes(*_TILES), _recipes(*_TILES))
    return pick(rng, (*styles, _recipes(_CARPET), _recipes(*_STONES)))(rng, palette)


def _boards(rng: Generator, palette: Palette) -> Material:
    pattern = patterns.planks(int(3 * rng.random()), pick(rng, (8, 10, 12)))
    return _planked(pattern, 1.6, rng, palette)


def _blocks(rng: Generator, palette: Palette) -> Material:
    ratio = pick(rng, (4, 5, 6))
    return _planked(patterns.herringbone(int(3 * rng.random()), ratio), 0.14 * ratio, rng, palette)


def _planked(pattern: Pattern, metres: float, rng: Generator, palette: Palette) -> Material:
    dark, light = (np.array(color) for color in palette.woods[0])
    recipe = Recipe("", (0.25, 0.5), rougher=0.15, seam="1a130d", rough_seam=0.9, metres=metres)
    return _shaded(recipe, pattern, dark, light, span(rng, *recipe.rough), rng, palette)


def _wall(name: str) -> Callable[[Generator, Palette], Material]:
    """Return the drawing of a wall in the first or the second colour of the walls."""
    paint = Recipe(name, (0.6, 0.95), patterns.roller, specular=0.3)
    plaster = Recipe(
        name, (0.85, 0.85), patterns.trowel, (0.87, 1.03), 0.1, metres=2.0, specular=0.2
    )

    def paper(rng: Generator, palette: Palette) -> Material:
        kind = pick(rng, ("stripes", "pin", "sprigs", "diamonds", "sprigs"))
        figure = patterns.figure(kind, pick(rng, (4, 5)), _seed(rng))
        color = np.array(_options(name, palette)[0])
        other = np.minimum(pick(rng, (0.82, 0.9, 1.08)) * color, 0.88)
        shades = lerp(color, other, patterns.levels()[1])
        return Material(shades, 0.75, figure, specular=0.3, metres=0.75)

    styles = (*4 * [_recipes(paint)], _recipes(plaster), paper)
    return lambda rng, palette: pick(rng, styles)(rng, palette)


def _door(rng: Generator, palette: Palette) -> Material:
    return _wood(rng, palette) if chance(rng, 0.3) else _painted(_TRIM[0], rng, palette)


def _sill(rng: Generator, palette: Palette) -> Material:
    return pick(rng, (_recipes(*_TRIM), _recipes(*_TRIM), _recipes(*_STONES), _wood))(rng, palette)


def _wood(rng: Generator, palette: Palette) -> Material:
    index, slopes = (
        np.roll(values, shift, axis=1)
        for shift in [int(rng.random() * patterns.SIZE)]
        for values in patterns.board(_seed(rng))
        if values is not None
    )
    share, _ = patterns.levels()
    rough = span(rng, 0.28, 0.5) + 0.14 * (1.0 - share)
    return Material(lerp(*palette.woods[1], share), rough, index, slopes, metres=0.6)


def _metal(rng: Generator, palette: Palette) -> Material:
    brushed = patterns.weave(0, 64, "plain").shades[::2, ::2]  # any fine field does
    share, _ = patterns.levels()
    color, rough = np.tile(palette.metal, (len(share), 1)), span(rng, 0.12, 0.4)
    return Material(color, rough + 0.05 * (share - 0.5), brushed, metallic=1.0, metres=0.1)


def _wicker(rng: Generator, palette: Palette) -> Material:
    dark, light = (np.array(c) for c in pick(rng, palette.woods))
    recipe = Recipe("", (0.6, 0.6), rougher=0.2, metres=0.16)
    pattern = patterns.wickerwork(int(3 * rng.random()))
    return _shaded(recipe, pattern, 0.35 * dark, 1.1 * light, 0.6, rng, palette)


_QUIET_FIGURES = ("stripes", "pin", "checks")
_FIGURES = (*_QUIET_FIGURES, "dots", "zigzag", "diamonds", "sprigs")


def _cloth(
    rng: Generator, color: Color, other: Color | None, style: str, threads: int, metres: float,
    kinds: tuple[str, ...] = _QUIET_FIGURES,
) -> Material:  # fmt: skip
    """Weave a cloth of one colour, or print or weave a figure of another colour into it."""
    pattern = patterns.weave(_seed(rng), threads, style)
    index = pattern.shades
    share, shown = patterns.levels()
    base = np.asarray(color, np.float32)[None]
    if other is not None:
        kind = pick(rng, kinds)
        count = pick(rng, (6, 8, 10)) if kind == "dots" else pick(rng, (3, 4, 5))
        base = lerp(color, other, shown)
        index = index // SEAMS * SEAMS + patterns.figure(kind, count, _seed(rng))
    light = np.minimum((0.45 + 0.75 * share)[:, None] * base, 0.88)
    return Material(light, 0.95, index, pattern.slopes, specular=0.1, metres=metres)


def _fabric(rng: Generator, palette: Palette) -> Material:
    """Draw upholstery, mostly of one colour."""
    color = pick(rng, (*palette.fabrics, palette.fabrics[0]))
    style = pick(rng, ("plain", "twill", "basket"))
    if chance(rng, 0.85):
        return _cloth(rng, color, None, style, 64, 0.2)
    return _cloth(rng, color, palette.fabrics[1], style, 128, 0.4)


def _printed(rng: Generator, palette: Palette) -> Material:
    """Draw cloth with figures, of cushions and throws."""
    color = pick(rng, palette.fabrics)
    others = tuple(c for c in (*palette.fabrics, *palette.accents) if c != color)
    return _cloth(rng, color, pick(rng, others), "plain", 128, 0.4, _FIGURES)


def _linen(rng: Generator, palette: Palette) -> Material:
    """Draw thin cloth in quiet colours, of sheets and curtains."""
    color = pick(rng, _options("neutrals0 neutrals0 fabrics1 walls0", palette))
    other = palette.fabrics[0] if chance(rng, 0.15) else None
    return _cloth(rng, color, other, "plain", 160, 0.35)


def _glow(rng: Generator, palette: Palette) -> Material:
    """Draw the cloth of a lamp shade."""
    color = pick(rng, _options("f3ece0 efe2c8 f5f3ee", palette))
    return _cloth(rng, color, None, "plain", 160, 0.3)


def _rug(rng: Generator, palette: Palette) -> Material:
    ground, colors = palette.fabrics[0], (*palette.fabrics[1:], *palette.accents)
    mixed = (0.75 * np.array(colors) + 0.25 * np.array(ground)).tolist()  # no rug is garish
    colors = tuple((r, g, b) for r, g, b in mixed)
    return pictures.rug(rng, ground, colors, patterns.pile(_seed(rng)))


def _pages(rng: Generator, palette: Palette) -> Material:
    """Draw the edges of pages: lines along v."""
    lines = np.random.default_rng(_seed(rng)).random(patterns.SIZE, np.float32)
    share = np.broadcast_to(lines, (8, patterns.SIZE))
    color = np.array(pick(rng, _options("ece4d0 e3d8bf f0ece2", palette)))
    return Material(lerp(0.7 * color, color, share), 0.95, specular=0.1, metres=0.2)


def _print(rng: Generator, palette: Palette) -> Material:
    """Draw printed card, of book covers and boxes."""
    options = _options("accents fabrics neutrals0 neutrals4", palette)
    return pictures.bands(rng, pick(rng, options), pick(rng, options), span(rng, 0.3, 0.6))


_DRAWN: dict[str, Callable[[Generator, Palette], Material]] = {
    "floor": _floor,
    "wall": _wall("walls0"),
    "accent": _wall("walls1"),
    "door": _door,
    "sill": _sill,
    "wood": _wood,
    "metal": _metal,
    "fabric": _fabric,
    "linen": _linen,
    "printed": _printed,
    "rug": _rug,
    "wicker": _wicker,
    "pages": _pages,
    "print": _print,
    "leaf": pictures.leaf,
    "glow": _glow,
    "picture": pictures.picture,
    "screen": pictures.screen,
    "dial": pictures.dial,
}
KINDS = (*_DRAWN, *_RECIPES)

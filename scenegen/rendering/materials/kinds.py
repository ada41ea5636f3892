"""Materials by kind, drawn from a stream of random numbers and the palette of a room."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from scenegen.common.names import check_choice
from scenegen.objects.families.parts.draws import pick, span
from scenegen.rendering.materials.fields import grid, noise, smoothstep
from scenegen.rendering.materials.material import Array, Material, lerp
from scenegen.rendering.materials.palettes import Palette

SIZE = 512  # pixels of a map's side
VARIANTS = 6  # fields of each pattern; colours make more of them


def material(kind: str, rng: Generator, palette: Palette) -> Material:
    """Draw a material of a kind. Raises SpecError for a kind that is not in KINDS."""
    check_choice("material", kind, KINDS)
    return _DRAWN[kind](rng, palette)


def _seed(rng: Generator) -> int:
    return int(rng.random() * VARIANTS)


def _grain(seed: int) -> Array:
    """Return the grain of wood along v: 0 dark, 1 light."""
    u, _ = grid(SIZE)
    bend = noise(seed, SIZE, 1.2, (6.0, 1.0))
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (9 * u + 0.9 * bend))
    fibre = noise(seed + 50, SIZE, 0.3, (24.0, 1.0), lowest=12)
    return np.clip(0.62 - 0.35 * rings**3 + 0.14 * fibre + 0.1 * bend, 0.0, 1.0)


def _wood(rng: Generator, palette: Palette) -> Material:
    grain = np.roll(_grain(_seed(rng)), int(rng.random() * SIZE), axis=1)
    dark, light = palette.woods[1]
    rough = span(rng, 0.3, 0.5)
    return Material(lerp(dark, light, grain), (rough + 0.12 * (1 - grain)).astype(np.float32))


def _wall(rng: Generator, palette: Palette) -> Material:
    roller = noise(_seed(rng), SIZE, 0.2, lowest=20, highest=120)
    stain = noise(_seed(rng) + 20, SIZE, 1.5, highest=8)
    color = lerp(0.97 * np.array(palette.walls[0]), palette.walls[0], 0.5 + 0.3 * stain)
    return Material(color, (0.85 + 0.03 * stain).astype(np.float32), 0.00012 * roller, specular=0.3)


def _fabric(rng: Generator, palette: Palette) -> Material:
    u, v = grid(SIZE)
    threads = 64
    weave = np.sin(2 * np.pi * threads * u) * np.sin(2 * np.pi * threads * v)
    fuzz = noise(_seed(rng), SIZE, 0.2, lowest=10)
    share = np.clip(0.6 + 0.25 * weave + 0.12 * fuzz, 0.0, 1.0).astype(np.float32)
    color = np.array(pick(rng, palette.fabrics))
    maps = lerp(0.6 * color, np.minimum(1.15 * color, 0.9), share)
    height = (0.0002 * weave).astype(np.float32)
    return Material(maps, 0.9, height, specular=0.15, metres=0.2)


def _metal(rng: Generator, palette: Palette) -> Material:
    brushed = noise(_seed(rng), SIZE, 0.0, (30.0, 1.0), lowest=10)
    rough = np.clip(span(rng, 0.15, 0.35) + 0.04 * brushed, 0.08, 1.0).astype(np.float32)
    return Material(np.array(palette.metal), rough, metallic=1.0, metres=0.3)


def _ceramic(rng: Generator, palette: Palette) -> Material:
    color = pick(rng, (palette.neutrals[0], palette.neutrals[0], *palette.accents))
    pooled = noise(_seed(rng), SIZE, 1.2, highest=20)
    maps = lerp(0.85 * np.array(color), color, smoothstep(-2.0, 1.0, pooled))
    return Material(maps, np.clip(0.12 + 0.02 * pooled, 0.05, 0.3).astype(np.float32), metres=0.4)


def _plain(source: str, rough: float, specular: float = 0.5) -> Callable[..., Material]:
    def draw(rng: Generator, palette: Palette) -> Material:
        colors = getattr(palette, source)
        color = colors if isinstance(colors[0], float) else pick(rng, colors)
        return Material(np.array(color), rough, specular=specular)

    return draw


_DRAWN: dict[str, Callable[[Generator, Palette], Material]] = {
    "floor": _wood,
    "wall": _wall,
    "ceiling": _plain("ceiling", 0.9, 0.2),
    "skirting": _plain("trim", 0.4),
    "door": _plain("trim", 0.4),
    "frame": _plain("trim", 0.4),
    "sill": _plain("trim", 0.4),
    "wood": _wood,
    "fabric": _fabric,
    "felt": _fabric,
    "leather": _plain("fabrics", 0.45),
    "metal": _metal,
    "ceramic": _ceramic,
    "plastic": _plain("accents", 0.35),
    "paint": _plain("neutrals", 0.4),
    "stone": _plain("neutrals", 0.2),
    "print": _plain("accents", 0.4),
    "paper": _plain("neutrals", 0.8),
    "leaf": _plain("accents", 0.5),
    "glow": _plain("neutrals", 0.7),
    "picture": _plain("accents", 0.5),
    "screen": _plain("neutrals", 0.1),
    "dial": _plain("neutrals", 0.5),
}
KINDS = tuple(_DRAWN)

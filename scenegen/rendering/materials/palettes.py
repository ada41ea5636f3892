"""Colours that people put together, for a whole room."""

from dataclasses import dataclass

import numpy as np

from scenegen.common.srgb import decoded
from scenegen.objects.families.parts.draws import chance, pick, span

Color = tuple[float, float, float]  # linear RGB, 0 to 1


@dataclass(frozen=True)
class Palette:
    """The colours of a room, in linear RGB.

    Attributes:
        walls: two that go together: most walls have the first.
        ceiling, trim: of ceilings, and of skirting, frames and doors.
        woods: dark and light ends of the grain, for floor and furniture.
        metal: reflectance at normal incidence.
        fabrics: of textiles, large ones first.
        accents: of small things.
        neutrals: of what should not be noticed.
    """

    walls: tuple[Color, Color]
    ceiling: Color
    trim: Color
    woods: tuple[tuple[Color, Color], tuple[Color, Color]]
    metal: Color
    fabrics: tuple[Color, ...]
    accents: tuple[Color, ...]
    neutrals: tuple[Color, ...]


# walls; fabrics; accents. Hexadecimal sRGB.
_SCHEMES = (
    ("eeebe4 d5cfc3", "b9b1a3 6d7468 dcd5c8 8a6f55", "c9a45c 5f6f60 b5533c d8cdbb"),
    ("f1efeb c8d0d2", "7d8a95 d9d6cf 42505e a8b3b8", "d99a4e 35566b c2c8c6 a3493d"),
    ("ede4d8 d9b8a0", "c98e6f e3d6c4 8c5a44 a99a86", "7a8b6f c46a4a e0b872 50463e"),
    ("e9ece6 b5c2ae", "8fa087 dfe0d6 5b6b57 c4b79c", "d0b35f 44604f b87a5a e8e3d5"),
    ("f3f1ee e2d4d0", "c4a29e e7dfda 8d6f72 b7b2ad", "b56b75 6b7f86 d9b99b 4c4346"),
    ("e6e7ea aab4c4", "5b6f8f d6dae2 303c54 9aa6b8", "e0a84a b7473a 7f95b5 e9e4d8"),
    ("f4efe3 e6d3a7", "c9b27e efe6d2 7c6a4a a4a08f", "3f6a73 c7743c 8a9a6a 2f3b45"),
    ("dfdcd6 8f9a99", "4d5a5b c9c5bc 8a8378 a7663f", "c58a4a 2f4548 d6cfbf 6f8683"),
    ("f0eeea 39505a", "36505c d8d2c6 a4743f 8c979a", "c9963f d4cdbd 7a3f34 52707a"),
    ("efeae6 c9b7c4", "8c7590 ddd3da 5a4a60 b7a9a0", "c79a5a 6a7a5f a8506a e6ddd2"),
    ("e8e3da 7d6a5a", "6a5546 d8ccb9 3f3630 a38c70", "b98a4a 7f3a2e 52614a e0d4bd"),
    ("f5f4f2 dadada", "9a9a98 3a3a3c e4e2de 6e6e70", "a8434a d0a655 46698f e8e8e6"),
    ("f2eee8 bcd0cc", "6fa09a e5e0d6 3c6a68 d8a58c", "e07a5f 3d5a6c f2cc8f 81b29a"),
    ("ebe6dd cbb094", "a8663a e0d4bf 5b3f2c c2b49a", "2f5d50 d9a441 8c3b2a ded6c4"),
)
# dark and light ends of the grain: oak, walnut, ash, cherry, pine, smoked oak, bleached oak
_WOODS = (
    "8a6240 b98e63", "4a3020 7a5537", "b59a78 d8c4a4", "6f3d24 9c6440", "b58a55 d9b681",
    "3a2c22 5c4838", "a8967c cbbba1", "7a5232 a97c52",
)  # fmt: skip
_METALS = ("c9cacb", "b8b9bb", "d8b47a", "b58a6a", "2c2c2e", "8f9093")
_NEUTRALS = "f2f0ec dcd9d2 a9a6a0 4a4947 262626"


def palette(rng: np.random.Generator) -> Palette:
    """Draw the colours of a room."""
    walls, fabrics, accents = (_colors(row) for row in pick(rng, _SCHEMES))
    floor, furniture = (_colors(pick(rng, _WOODS)) for _ in range(2))
    if chance(rng, 0.5):
        furniture = floor
    shade = span(rng, 0.9, 1.08)  # no two rooms have quite the same wall
    if chance(rng, 0.3) and min(walls[1]) > 0.15:
        walls = walls[::-1]
    first = tuple(min(shade * c, 0.86) for c in walls[0])
    white = span(rng, 0.76, 0.84)
    trim = (white, white, 0.97 * white)
    return Palette(
        walls=((first[0], first[1], first[2]), walls[1]),
        ceiling=(white, 0.995 * white, 0.985 * white),
        trim=trim,
        woods=((floor[0], floor[1]), (furniture[0], furniture[1])),
        metal=_colors(pick(rng, _METALS))[0],
        fabrics=fabrics,
        accents=accents,
        neutrals=_colors(_NEUTRALS),
    )


def _colors(row: str) -> tuple[Color, ...]:
    return tuple(linear(name) for name in row.split())


def linear(name: str) -> Color:
    """Decode a colour of six hexadecimal digits, sRGB."""
    r, g, b = decoded([int(name[i : i + 2], 16) / 255 for i in (0, 2, 4)]).tolist()
    return r, g, b

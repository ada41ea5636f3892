"""Pictures as terminals draw them: the sixels of DEC's VT340, and kitty's graphics protocol.

Both are text, to be printed where the picture shall begin. Sixel needs no more than a palette of
256 colours; kitty's protocol has all colours, as PNG.
"""

import base64
import io
import re

import numpy as np
from PIL import Image

COLORS = 256  # as many as terminals keep for sixels
BAND = 6  # rows of pixels that a line of sixels holds
CHUNK = 4096  # characters of base64 in one of kitty's escapes
PER_CENT = 100 / 255


def escapes(picture: Image.Image, protocol: str, width: int) -> str:
    """Return what a terminal that is `width` pixels wide draws, by "kitty" or "sixel".

    A wider picture is made smaller.
    """
    if picture.width > width:
        size = width, max(1, round(picture.height * width / picture.width))
        picture = picture.resize(size, Image.Resampling.LANCZOS)
    return {"kitty": kitty, "sixel": sixel}[protocol](picture.convert("RGB"))


def kitty(picture: Image.Image) -> str:
    """Return a picture in kitty's protocol: a PNG file in chunks, to which nothing is answered."""
    file = io.BytesIO()
    picture.save(file, "PNG")
    data = base64.standard_b64encode(file.getvalue()).decode()
    chunks = [data[start : start + CHUNK] for start in range(0, len(data), CHUNK)]
    keys = ["a=T,f=100,q=2,", *[""] * (len(chunks) - 1)]
    more = [*[1] * (len(chunks) - 1), 0]
    parts = zip(keys, more, chunks, strict=True)
    return "".join(f"\x1b_G{key}m={m};{chunk}\x1b\\" for key, m, chunk in parts)


def sixel(picture: Image.Image) -> str:
    """Return an RGB picture as sixels, in at most 256 colours that suit it."""
    indexed = quantized(picture)
    palette = np.rint(np.array(indexed.getpalette()).reshape(-1, 3) * PER_CENT).astype(int)
    pixels = np.asarray(indexed)
    colors = (f"#{i};2;{r};{g};{b}" for i, (r, g, b) in enumerate(palette.tolist()))
    bands = (_band(pixels[top : top + BAND]) for top in range(0, picture.height, BAND))
    size = f'"1;1;{picture.width};{picture.height}'
    return f"\x1bP0;1q{size}{''.join(colors)}{'-'.join(bands)}\x1b\\"


def quantized(picture: Image.Image) -> Image.Image:
    """Return an RGB picture in at most 256 colours, each near to what it stands for."""
    return picture.quantize(COLORS, Image.Quantize.MAXCOVERAGE, kmeans=1)


def _band(rows: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> str:
    """Return up to six rows of palette indices as sixels: for each colour, where it is."""
    places = np.arange(rows.size) % rows.shape[1]
    bits = np.repeat(1 << np.arange(len(rows)), rows.shape[1])
    used, which = np.unique(rows, return_inverse=True)
    marks = np.zeros((len(used), rows.shape[1]), np.uint8)
    np.add.at(marks, (which.reshape(-1), places), bits.astype(np.uint8))
    lines = (_packed((line + 63).tobytes().decode()) for line in marks)
    return "$".join(f"#{color}{line}" for color, line in zip(used.tolist(), lines, strict=True))


def _packed(line: str) -> str:
    """Return sixels with runs counted, and without what is empty at the end."""
    return re.sub(r"(.)\1{3,}", lambda run: f"!{len(run[0])}{run[1]}", line.rstrip("?"))

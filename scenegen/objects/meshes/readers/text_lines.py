"""Lines and points of text files, whoever wrote them."""

import codecs
import io
import math
from collections.abc import Iterator

_NOT_FINITE = (math.nan, math.nan, math.nan)


def lines(data: bytes) -> Iterator[bytes]:
    """Give lines one by one, however they end, of UTF-8, Latin or UTF-16 text."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = data.decode("utf-16", "replace").encode("utf-8", "replace")
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    return iter(io.BytesIO(data))


def point(words: list[bytes]) -> tuple[float, float, float]:
    """Return three numbers; what is broken gives a point that is not finite."""
    try:
        x, y, z = map(float, words)
    except ValueError:
        return _NOT_FINITE
    return x, y, z

"""How much of 8-bit images is saturated or black: where light is too strong or too weak."""

from collections.abc import Sequence

import numpy as np

from scenegen.rooms.reader import RoomsFile

MANY = 0.05  # share of values that calls for a warning
STORE_ALL = "store unclipped radiance with --image-dtype float16"
Shares = tuple[float, float]  # of values that are saturated, and black


def clipped_shares(rooms: RoomsFile, rows: Sequence[int]) -> Shares | None:
    """Return which share of the values of 8-bit images is 255, and which is 0.

    Pixels that show nothing do not count. None for images of other types, which are not clipped,
    and for files without truth. Raises FileFormatError where a row is damaged.
    """
    if rooms.spec.image_dtype != "uint8" or not rooms.has_truth:
        return None
    count = saturated = black = 0
    for row in rows:
        shown = rooms.read("image", row)[rooms.read("object_id", row) >= 0]
        count += shown.size
        saturated += int(np.count_nonzero(shown == 255))
        black += int(np.count_nonzero(shown == 0))
    return (saturated / count, black / count) if count else None


def exposure_text(shares: Shares) -> str:
    """Return the shares in words."""
    return f"{shares[0]:.1%} of values saturated (255), {shares[1]:.1%} black (0)"


def exposure_warnings(shares: Shares, interior: bool = False) -> list[str]:
    """Return a sentence if many values are saturated, and one if many are black."""
    advice = STORE_ALL if interior else f"change --light-level, or {STORE_ALL}"  # they expose alone
    return [
        f"{share:.0%} of the values of 8-bit images are {what}; {advice}"
        for share, what in zip(shares, ("saturated", "black"), strict=True)
        if share >= MANY
    ]

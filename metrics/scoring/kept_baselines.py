"""Scores of baselines that follow from the truth alone, kept from one submission to the next.

They take as long as the scores of a submission. An entry belongs to the content of a row, to the
code that computes it and to the libraries under it, so it never grows old; a damaged one is made
again. It holds some numbers, no pixels.
"""

import functools
import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import metrics.measures
from metrics.scoring.images import geometry, image_scores
from metrics.scoring.images.image_scores import FirstView
from metrics.scoring.metric_names import ALL
from metrics.scoring.runs import scorer_versions
from metrics.scoring.truth_digests import RowDigests
from metrics.submissions.truths import TrueView
from scenegen import camera
from scenegen.files.content import row_digest
from scenegen.objects.cache import DiskCache, default_cache_dir

MOST_BYTES = 200_000_000
_NAMES, _VALUES = "names", "values"
_IN_ORDER = tuple(ALL)


class KeptBaselines:
    """The baselines of rows in the user's cache; processes may share it."""

    def __init__(self) -> None:
        self._disk = DiskCache(default_cache_dir("baselines"), MOST_BYTES, warns=False)

    def read(self, key: str) -> dict[str, float] | None:
        """Return the scores of a row by name; None where they are not kept."""
        kept = self._disk.read(key, (_NAMES, _VALUES))
        if kept is None:
            return None
        names = [_IN_ORDER[i] for i in kept[_NAMES].tolist()]
        return dict(zip(names, kept[_VALUES].tolist(), strict=True))

    def write(self, key: str, scores: dict[str, float]) -> None:
        """Keep the scores of a row."""
        places = np.array([_IN_ORDER.index(name) for name in scores], np.int16)
        self._disk.write(key, {_NAMES: places, _VALUES: np.array([*scores.values()])})


def key_of(view: TrueView, digests: RowDigests, first: FirstView | None, row: int) -> str:
    """Return the key of a row: a hash of all that its baselines follow from."""
    parts = [*digests, _digest(np.array([row]), view.world_from_camera), repr(view.lens).encode()]
    parts.append(_digest(view.room_size) if view.room_size is not None else b"open")
    if first is not None:
        parts.append(_digest(first.depth, first.object_id, first.world_from_camera))
    return hashlib.sha256(b"|".join([_program(), *parts])).hexdigest()


def _digest(*arrays: NDArray[np.generic]) -> bytes:
    return b"".join(row_digest(np.ascontiguousarray(array)) for array in arrays)


@functools.cache
def _program() -> bytes:
    """Return a hash of the code that makes baselines, and of the libraries that it needs."""
    folder = Path(*metrics.measures.__path__)
    files = [Path(str(module.__file__)) for module in (geometry, image_scores, camera)]
    text = b"".join(file.read_bytes() for file in (*sorted(folder.rglob("*.py")), *files))
    return hashlib.sha256(text + repr(sorted(scorer_versions().items())).encode()).digest()

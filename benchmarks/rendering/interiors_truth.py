"""Print the digest of the truth of interiors-512-1.

`python -m benchmarks.rendering.interiors_truth FOLDER` makes that truth in a
folder, without pictures, which take long.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from metrics.scoring.known_tests import sets
from metrics.scoring.truth_digests import file_digests
from scenegen.description.presets import preset_spec
from scenegen.rooms import render
from scenegen.rooms.make import make_dataset

VIEWS, SEED, COUNT, SIZE = (0.0, 10.0, 20.0, 30.0), 1000, 100, 512


def no_pictures(batch: Any, names: list[str], device: str) -> dict[str, Any]:
    """Return black pictures in the place of traced ones."""
    del device
    shape = len(batch), SIZE, SIZE, 3
    return {x: np.zeros((len(batch), 5)) if x == "exposure" else np.zeros(shape, np.uint8)
            for x in names}  # fmt: skip


if __name__ == "__main__":
    spec = preset_spec("interiors", views=VIEWS, seed=SEED, height=SIZE, width=SIZE,
                       object_split="test", denoise=True)  # fmt: skip
    render.trace = no_pictures
    path = Path(sys.argv[1]) / "truth-of-interiors.h5"
    make_dataset(path, spec, COUNT, batch=16, shard_size=COUNT, compression="none", overwrite=True)
    (test,) = sets()["interiors-512-1"]
    print(file_digests(path, "rooms")[0], "is published:", test.digest)

"""A file of measured truth of three sizes, and predictions of it."""

import numpy as np
import pytest
from measured_scenes import scene

from metrics.measured.writer import Measured, Source, write_measured
from metrics.submissions.writer import RoomPredictionWriter

K = np.array([[60.0, 0.0, 31.0], [0.0, 61.0, 23.0], [0.0, 0.0, 1.0]])
COUNT = 12


@pytest.fixture(scope="session")
def measured(tmp_path_factory):
    """Write truth of 12 images in groups of two, of which a share of the pixels was measured."""

    def made(share=0.9, count=COUNT, normals=False, noise=0.0, groups=True):
        path = tmp_path_factory.mktemp("measured") / "truth.h5"
        rng = np.random.default_rng(1)

        def one(i, height, width):
            depth = scene(i, height, width)
            depth = depth * (1.0 + noise * rng.standard_normal(depth.shape))
            depth[rng.random(depth.shape) > share] = np.nan
            image = rng.integers(0, 256, (height, width, 3), np.uint8)
            normal = np.broadcast_to((0.0, 0.6, 0.8), image.shape) if normals else None
            return Measured(image, depth, K, normal)

        sizes = [(48 - 2 * (i % 3), 64 - i % 2) for i in range(count)]
        group = 2 if groups else 1
        rows = [
            Source(f"{i}.png", f"scene {i // group}", s, lambda i=i, s=s: one(i, *s))
            for i, s in enumerate(sizes)
        ]
        write_measured(path, rows, source="tests", licence="CC0")
        return path

    return made


@pytest.fixture
def predicted(tmp_path):
    """Write predictions of such a file: what a function makes of the whole true depth."""

    def made(truth, change, name="p", **texts):
        from metrics.measured.reader import MeasuredFile

        path = tmp_path / f"{name}.h5"
        with (
            MeasuredFile(truth) as file,
            RoomPredictionWriter(path, truth, method=name, **texts) as out,  # type: ignore[arg-type]
        ):
            for row in range(len(file)):
                depth = scene(row, *file.size(row))
                rng = np.random.default_rng(row)
                values = change(depth, rng)
                out.add(row, **(values if isinstance(values, dict) else {"depth": values}))
        return path

    return made

"""True volumes of polycubes find the right answer, and not its mirror image."""

import numpy as np
import torch
from ptn_models import cubes_volume, tiny

from baselines.ptn.matching import best_fits
from baselines.ptn.questions import uniform_rotation
from iqtt.shapes.polycube import mirror

CHAIN = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0], [2, 2, 1], [2, 2, 2]])
OTHER = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0], [1, 2, 1]])


def test_the_turned_shape_fits_better_than_its_mirror_image_and_another():
    model, rng = tiny("questions"), np.random.default_rng(1)
    for _ in range(3):
        views = [uniform_rotation(rng) for _ in range(4)]
        shapes = (CHAIN, CHAIN, mirror(CHAIN), OTHER)
        reference, *answers = (
            cubes_volume(model, c, t) for c, t in zip(shapes, views, strict=True)
        )
        fits = best_fits(reference[0], torch.cat(answers))
        assert fits[0] > 0.8
        assert fits[0] > fits[1:].max() + 0.05

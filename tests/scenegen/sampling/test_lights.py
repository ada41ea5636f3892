"""Lights: how many, where, and as bright together as is said."""

import numpy as np
from scipy.stats import chisquare, kstest

from scenegen.description.specs import DatasetSpec
from scenegen.sampling.lights import sample_lights


def test_lights_are_as_many_as_bright_and_where_the_spec_says():
    """Each number is as probable; uniform by area on an octant means uniform in height."""
    spec = DatasetSpec(lights=(1, 3), light_saturation=0.8, seed=3)
    count, position, color = sample_lights(spec, np.arange(3000))
    assert chisquare(np.bincount(count, minlength=4)[1:]).pvalue > 1e-3
    used = np.arange(3) < count[:, None]
    assert not position[~used].any()
    assert not color[~used].any()
    away = position[used] - spec.camera_target
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), spec.light_radius)
    assert kstest(away[:, 1] / spec.light_radius, "uniform").pvalue > 1e-3
    assert (away >= -1e-12).all()
    k_l, k_q = spec.attenuation
    falloff = k_l * spec.light_radius + k_q * spec.light_radius**2
    brightest = color.max(axis=-1) / falloff
    np.testing.assert_allclose(brightest.sum(axis=1), spec.light_level)
    np.testing.assert_allclose(brightest[used], (spec.light_level / count)[np.nonzero(used)[0]])
    assert (color[used].min(axis=-1) >= 0.2 * color[used].max(axis=-1)).all()

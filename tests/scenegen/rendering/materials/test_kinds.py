"""Materials: within range, without seams, of the palette, the same again."""

import itertools

import numpy as np
import pytest

from scenegen.objects.furniture.furnishing import WHOLE
from scenegen.rendering.materials.kinds import KINDS, material
from scenegen.rendering.materials.material import SLOPE_STEPS, Material, slopes_of
from scenegen.rendering.materials.palettes import palette


def drawn(kind, seed):
    rng = np.random.default_rng((seed, 11))
    return material(kind, rng, palette(rng))


def color_map(made):
    return made.base_color if made.index is None else made.base_color[made.index]


def slope_maps(made):
    """Slopes of a material along u and v, (2, H, W)."""
    both = (
        np.ascontiguousarray(made.slopes)
        .view(np.int16)
        .reshape(*made.slopes.shape, 2)
        .transpose(2, 0, 1)
    )
    return both * (made.bumps / (SLOPE_STEPS * made.metres))


def maps_of(made):
    rough = made.roughness
    if made.index is not None and np.ndim(rough):
        rough = rough[made.index]
    for values in (color_map(made), rough, *(() if made.slopes is None else slope_maps(made))):
        if np.ndim(values) > 1:
            yield values


@pytest.mark.parametrize("kind", KINDS)
def test_maps_are_within_range_and_repeat_without_seams(kind):
    for seed in range(4):
        made = drawn(kind, seed)
        color = np.asarray(made.base_color)
        assert color.shape[-1] == 3
        assert color.min() >= 0.0
        assert color.max() <= 0.9
        assert np.min(made.roughness) >= 0.04
        assert np.max(made.roughness) <= 1.0
        assert 0.0 <= made.specular <= 1.0
        assert made.metallic in (0.0, 1.0)
        assert made.metres > 0.0
        maps = list(maps_of(made))
        assert all(np.isfinite(values).all() for values in maps)
        if made.slopes is not None:
            assert slope_maps(made).any()
            assert np.quantile(np.abs(slope_maps(made)), 0.9) < 1.0
        for values, axis in itertools.product(maps, (0, 1) if kind not in WHOLE else ()):
            steps = np.abs(np.diff(values, axis=axis, append=values.take([0], axis)))
            steps = steps.mean(axis=1 - axis).reshape(values.shape[axis], -1).mean(axis=1)
            assert steps[-1] <= 1.5 * np.quantile(steps, 0.995) + 1e-6


def test_texels_hold_colours_and_roughness():
    colors = np.array([[0.25, 0.0, 1.0], [0.04, 0.36, 0.64]])
    index = np.array([[0, 1, 1]], np.uint16)
    texels = Material(colors, np.array([0.2, 1.0]), index).texels()
    assert texels.tolist() == [[0x33FF0080, *2 * [0xFFCC9933]]]


def test_slopes_are_those_of_heights():
    u = (np.arange(64) + 0.5) / 64 * 2 * np.pi
    height = 0.01 * np.sin(u) + 0.02 * np.cos(u)[:, None]
    made = Material(np.ones(3), 0.5, slopes=slopes_of(height), bumps=0.5, metres=0.8)
    along, up = slope_maps(made)
    expected = 0.5 * 2 * np.pi / 0.8 * np.cos(u) * 0.01
    np.testing.assert_allclose(along[5], expected, atol=1e-4)
    np.testing.assert_allclose(up[:, 5], -0.02 * 0.5 * 2 * np.pi / 0.8 * np.sin(u), atol=2e-4)

"""Materials: within range, without seams, of the palette, the same again."""

import numpy as np
import pytest

from scenegen.common.errors import SpecError
from scenegen.objects.furniture.furnishing import FAMILIES_FACTS, WHOLE, furnishing
from scenegen.rendering.materials.kinds import KINDS, material
from scenegen.rendering.materials.material import SLOPE_STEPS, Material, slopes_of
from scenegen.rendering.materials.palettes import palette

EVERY = pytest.mark.parametrize("kind", KINDS)


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


@EVERY
def test_maps_are_within_range(kind):
    for seed in range(8):
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
        for values in maps_of(made):
            assert np.isfinite(values).all()
        if made.slopes is not None:
            assert slope_maps(made).any()
            assert np.quantile(np.abs(slope_maps(made)), 0.9) < 1.0


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in WHOLE])
def test_maps_repeat_without_seams(kind):
    for seed in range(8):
        for values in maps_of(drawn(kind, seed)):
            for axis in (0, 1):
                steps = np.abs(np.diff(values, axis=axis, append=values.take([0], axis)))
                steps = steps.mean(axis=1 - axis).reshape(values.shape[axis], -1).mean(axis=1)
                assert steps[-1] <= 1.5 * np.quantile(steps, 0.995) + 1e-6


@EVERY
def test_the_same_stream_draws_the_same_material(kind):
    first, second = drawn(kind, 3), drawn(kind, 3)
    np.testing.assert_array_equal(first.base_color, second.base_color)
    np.testing.assert_array_equal(first.roughness, second.roughness)


@pytest.mark.parametrize("kind", ["wood", "fabric", "floor", "wall", "picture", "rug", "print"])
def test_streams_and_palettes_make_a_difference(kind):
    means = {tuple(np.round(np.mean(color_map(drawn(kind, s)), axis=(0, 1)), 3)) for s in range(8)}
    assert len(means) > 5


def test_rooms_keep_to_their_palette():
    room = palette(np.random.default_rng(5))
    for seed in range(4):
        wall = material("wall", np.random.default_rng(seed), room)
        mean = color_map(wall).mean(axis=(0, 1))
        np.testing.assert_allclose(mean, room.walls[0], rtol=0.2)


def test_every_part_of_every_family_has_a_material():
    kinds = {k for f in FAMILIES_FACTS for n in range(8) for k in furnishing(f, n).materials}
    assert kinds <= set(KINDS)
    assert len(kinds) > 20


def test_unknown_kinds_are_refused():
    with pytest.raises(SpecError) as error:
        drawn("mahogany", 0)
    assert error.value.where == "material"


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

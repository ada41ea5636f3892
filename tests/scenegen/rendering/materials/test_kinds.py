"""Materials: within range, without seams, of the palette, the same again."""

import numpy as np
import pytest

from scenegen.common.errors import SpecError
from scenegen.objects.furnishing import FAMILIES_FACTS, WHOLE, furnishing
from scenegen.rendering.materials.kinds import KINDS, material
from scenegen.rendering.materials.palettes import palette

EVERY = pytest.mark.parametrize("kind", KINDS)


def drawn(kind, seed):
    rng = np.random.default_rng((seed, 11))
    return material(kind, rng, palette(rng))


def maps_of(made):
    for values in (made.base_color, made.roughness, made.height):
        if values is not None and np.ndim(values) > 1:
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
            assert values.dtype == np.float32
            assert np.isfinite(values).all()
        if made.height is not None:
            slope = np.diff(made.height, axis=0) * len(made.height) / made.metres
            assert np.quantile(np.abs(slope), 0.9) < 1.0


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
    means = {tuple(np.round(np.mean(drawn(kind, s).base_color, axis=(0, 1)), 3)) for s in range(8)}
    assert len(means) > 5


def test_rooms_keep_to_their_palette():
    room = palette(np.random.default_rng(5))
    for seed in range(4):
        wall = material("wall", np.random.default_rng(seed), room).base_color
        mean = wall.mean(axis=(0, 1))
        np.testing.assert_allclose(mean, room.walls[0], rtol=0.2)


def test_every_part_of_every_family_has_a_material():
    kinds = {k for f in FAMILIES_FACTS for n in range(25) for k in furnishing(f, n).materials}
    assert kinds <= set(KINDS)
    assert len(kinds) > 20


def test_unknown_kinds_are_refused():
    with pytest.raises(SpecError) as error:
        drawn("mahogany", 0)
    assert error.value.where == "material"


@EVERY
def test_bumps_are_nowhere_flat(kind):
    """Mitsuba's bump maps return NaN where they are."""
    for seed in range(4):
        height = drawn(kind, seed).height
        if height is not None:
            slopes = (height - np.roll(height, 1, axis=axis) for axis in (0, 1))
            assert not np.logical_and(*(slope == 0.0 for slope in slopes)).any()

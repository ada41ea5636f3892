"""The choice of backend, and that the scalar fallback gives the same images."""

from dataclasses import replace

import pytest
from model_rooms import FAMILIES
from other_engines import render_by_the_fallback

from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render

TINY = DatasetSpec(
    height=18, width=22, objects=(2, 3), image_dtype="float32", shadows=True, spp=2, seed=1,
    min_visible_pixels=0, shapes=("sphere", "cone", "teapot", "prism"),
)  # fmt: skip

GLOSSY_MODELS = replace(FAMILIES, height=24, width=24, specular=(0.2, 0.5), shininess=(3.0, 9.0))


@pytest.mark.parametrize(
    "spec",
    [
        pytest.param(TINY, id="shapes"),
        pytest.param(GLOSSY_MODELS, id="glossy models", marks=pytest.mark.slow),
    ],
)
def test_the_scalar_fallback_agrees_with_the_wavefront(spec, scenes_of):
    """In a process of its own, where no vectorised variant is ever loaded."""
    scenes = scenes_of(spec, 4)
    slow, fast = render_by_the_fallback(spec, scenes), render(pack(spec, scenes))
    for name in fast.pixels():
        ours, theirs = getattr(fast, name), getattr(slow, name)
        assert (ours.shape, ours.dtype) == (theirs.shape, theirs.dtype)
    same = fast.object_id == slow.object_id
    assert same.mean() > 0.997
    assert (fast.object_id > 0).mean() > 0.03
    fine = spec is TINY  # models have smaller triangles
    assert (abs(fast.depth - slow.depth)[same] < 1e-5).mean() > (0.999 if fine else 0.995)
    aligned = abs(fast.normal - slow.normal).max(axis=-1) < 1e-3
    assert aligned[same].mean() > (0.999 if fine else 0.99)
    assert (abs(fast.image - slow.image).max(axis=-1) < 1e-3).mean() > (0.99 if fine else 0.985)

"""The path tracer's material has the lobes of the shading equation and samples its own density."""

import importlib

import numpy as np
import pytest
from scipy.stats import chi2

from scenegen.rendering.shading import shade

RHO = np.array([0.5, 0.25, 0.75])
MATERIALS = [(0.4, 1.0), (0.8, 8.0), (0.3, 64.0), (2.0, 20.0)]  # k_s, m
INCIDENT = [0.0, 0.5, 1.2, 1.5]  # from the normal, radians
COUNT = 100_000


@pytest.fixture(scope="module")
def phong_material(variant):
    """Return the module, whose import needs the variant to be chosen."""
    return importlib.import_module("scenegen.rendering.path_tracing.phong_material")


def toward(angle, azimuth=0.7):
    around = np.sin(angle)
    return np.array([around * np.cos(azimuth), around * np.sin(azimuth), np.cos(angle)])


def lanes(vectors):
    import mitsuba as mi

    return mi.Vector3f(*(mi.Float(x) for x in np.atleast_2d(vectors).T))


def call(bsdf, wi, wo):
    """Return f cos(theta), (R, 3), and the density, (R,)."""
    import drjit as dr
    import mitsuba as mi

    si = dr.zeros(mi.SurfaceInteraction3f, len(wo))
    si.wi = lanes(np.broadcast_to(wi, wo.shape))
    value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, lanes(wo))
    return np.asarray(value).T + np.zeros((len(wo), 3)), np.asarray(pdf) + np.zeros(len(wo))


def drawn(bsdf, wi):
    """Return COUNT directions, their densities, and their weights."""
    import drjit as dr
    import mitsuba as mi

    rng = np.random.default_rng(4)
    si = dr.zeros(mi.SurfaceInteraction3f, COUNT)
    si.wi = lanes(np.broadcast_to(wi, (COUNT, 3)))
    one, two, three = (mi.Float(rng.random(COUNT)) for _ in range(3))
    sample, weight = bsdf.sample(mi.BSDFContext(), si, one, mi.Point2f(two, three))
    return np.asarray(sample.wo).T, np.asarray(sample.pdf), np.asarray(weight).T


def hemisphere(heights=600, azimuths=720):
    """Return directions of cells with equal solid angle, uniform in height, and that angle."""
    z = (np.arange(heights) + 0.5) / heights
    turn = (np.arange(azimuths) + 0.5) * (2 * np.pi / azimuths)
    around = np.sqrt(1 - z**2)[:, None]
    grid = [around * np.cos(turn), around * np.sin(turn), z[:, None] + 0 * turn]
    return np.stack(grid, axis=-1).reshape(-1, 3), 2 * np.pi / (heights * azimuths)


@pytest.mark.parametrize("material", MATERIALS, ids=str)
def test_under_a_point_light_it_is_the_shading_equation(material, phong_material):
    """f cos(theta) times pi; a light of colour 1 at distance 2, k_l d + k_q d^2 being 1 there."""
    specular, shininess = material
    bsdf = phong_material.phong_bsdf(RHO, specular, shininess)
    rng = np.random.default_rng(5)
    wi, wo = rng.standard_normal((2, 200, 3))
    wi, wo = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))
    wi[:, 2] = abs(wi[:, 2])
    for one, other in zip(wi, wo, strict=True):
        expected = shade(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), RHO, 2 * other[None],
                         np.ones((1, 3)), np.zeros(3), np.array([0.5, 0.0]), specular, shininess,
                         3 * one)  # fmt: skip
        for side in (1, -1):
            found, _ = call(bsdf, one * [1, 1, side], other[None] * [1, 1, side])
            np.testing.assert_allclose(np.pi * found, expected, rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize(
    ("material", "angle"),
    [
        pytest.param(material, angle, marks=[] if i == k else pytest.mark.slow)
        for i, material in enumerate(MATERIALS)
        for k, angle in enumerate(INCIDENT)
    ],
)
def test_directions_come_as_often_as_their_density_says(material, angle, phong_material):
    """Chi-square over 24 x 16 cells above the surface, and one for those lost below it."""
    bsdf = phong_material.phong_bsdf(RHO, *material)
    wi = toward(angle)
    wo, pdf, weight = drawn(bsdf, wi)
    np.testing.assert_allclose(np.linalg.norm(wo, axis=1), 1, atol=1e-5)
    value, again = call(bsdf, wi, wo)
    np.testing.assert_allclose(pdf, again, rtol=1e-4)
    used = pdf > 0
    np.testing.assert_allclose(weight[used], (value / np.maximum(pdf, 1e-30)[:, None])[used],
                               rtol=1e-3)  # fmt: skip
    assert (weight[~used] == 0).all()
    assert ((wo[:, 2] > 0) == used).all()

    def cell(directions):
        turn = np.arctan2(directions[:, 1], directions[:, 0]) % (2 * np.pi)
        row = np.minimum((directions[:, 2] * 24).astype(int), 23)
        return row * 16 + np.minimum((turn * (16 / (2 * np.pi))).astype(int), 15)

    above, solid = hemisphere()
    share = np.bincount(cell(above), call(bsdf, wi, above)[1] * solid, minlength=24 * 16)
    assert share.sum() < 1 + 1e-4
    expected = COUNT * np.append(share, max(0.0, 1 - share.sum()))
    counts = np.append(np.bincount(cell(wo[used]), minlength=24 * 16), (~used).sum())
    many = expected > 8
    counts, expected = (np.append(x[many], x[~many].sum()) for x in (counts, expected))
    enough = expected > 1
    statistic = ((counts - expected)[enough] ** 2 / expected[enough]).sum()
    assert chi2.sf(statistic, enough.sum() - 1) > 1e-4


@pytest.mark.parametrize("material", MATERIALS, ids=str)
def test_samples_weigh_what_the_surface_reflects_and_no_more_than_promised(
    material, phong_material
):
    specular, shininess = material
    bsdf = phong_material.phong_bsdf(RHO, specular, shininess)
    above, solid = hemisphere()
    most = RHO + 2 * specular / (shininess + 1)
    for angle in INCIDENT:
        wi = toward(angle)
        albedo = call(bsdf, wi, above)[0].sum(axis=0) * solid
        weights = drawn(bsdf, wi)[2]
        error = weights.std(axis=0) / COUNT**0.5
        assert (abs(weights.mean(axis=0) - albedo) < 4.5 * error + 1e-4).all()
        assert (albedo <= most * (1 + 1e-4)).all()
        if angle == 0:
            np.testing.assert_allclose(albedo, most, rtol=2e-4)


def test_both_sides_reflect_alike(phong_material):
    flip = np.array([1.0, 1.0, -1.0])
    bsdf = phong_material.phong_bsdf(RHO, 0.6, 9.0)
    for angle in INCIDENT:
        (wo, pdf, weight), (wo_below, *below) = (
            drawn(bsdf, toward(angle)), drawn(bsdf, toward(angle) * flip)
        )  # fmt: skip
        np.testing.assert_array_equal(wo_below, wo * flip)
        np.testing.assert_array_equal(below[0], pdf)
        np.testing.assert_array_equal(below[1], weight)


@pytest.mark.parametrize("material", [(0.01, 10_000.0), (10.0, 1.0), (10.0, 10_000.0)], ids=str)
@pytest.mark.parametrize("rho", [0.0, 1.0])
def test_the_extremes_of_what_may_be_asked_for_stay_finite(material, rho, phong_material):
    bsdf = phong_material.phong_bsdf(np.full(3, rho), *material)
    for angle in (*INCIDENT, 1.5707):
        wo, pdf, weight = drawn(bsdf, toward(angle))
        for values in (wo, pdf, weight, *call(bsdf, toward(angle), wo)):
            assert np.isfinite(values).all()
        assert weight.min() >= 0

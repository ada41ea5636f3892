"""Paths reflect by the lobes of the shading equation, and sample their own density."""

import numpy as np
import pytest
from scipy.stats import chi2

from scenegen.rendering.shading import shade

RHO = np.array([0.5, 0.25, 0.75])
MATERIALS = [(0.4, 1.0), (0.8, 8.0), (0.3, 64.0), (2.0, 20.0)]  # k_s, m
INCIDENT = [0.0, 0.5, 1.2, 1.5]  # from the normal, radians
COUNT = 100_000


def toward(angle, azimuth=0.7):
    around = np.sin(angle)
    return np.array([around * np.cos(azimuth), around * np.sin(azimuth), np.cos(angle)])


def lanes(vectors):
    import mitsuba as mi

    return mi.Vector3f(*(mi.Float(x) for x in np.atleast_2d(vectors).T))


@pytest.fixture
def lobes_of(variant):
    """Return a function from k_s, m and the direction to the viewer to lobes, +z being up."""
    import mitsuba as mi

    from scenegen.rendering.pictures.paper_rooms import Phong

    def lobes(material, wi, rho=RHO):
        n, mirrored = mi.Vector3f(0, 0, 1), lanes(wi * [-1, -1, 1])
        return Phong(n, n, mirrored, mi.Color3f(*map(float, rho)), *map(mi.Float, material))

    return lobes


def call(lobes, wo):
    """Return f cos(theta), (R, 3), and the density, (R,)."""
    value, pdf = lobes.reflected(lanes(wo))
    return np.asarray(value).T + np.zeros((len(wo), 3)), np.asarray(pdf) + np.zeros(len(wo))


def drawn(lobes):
    """Return COUNT directions, their densities, and their weights."""
    import mitsuba as mi

    rng = np.random.default_rng(4)
    which, x, y = (mi.Float(rng.random(COUNT)) for _ in range(3))
    wo, weight, pdf = lobes.sampled(which, mi.Point2f(x, y))
    return np.asarray(wo).T, np.asarray(pdf), np.asarray(weight).T + np.zeros((COUNT, 3))


def hemisphere(heights=600, azimuths=720):
    """Return directions of cells with equal solid angle, uniform in height, and that angle."""
    z = (np.arange(heights) + 0.5) / heights
    turn = (np.arange(azimuths) + 0.5) * (2 * np.pi / azimuths)
    around = np.sqrt(1 - z**2)[:, None]
    grid = [around * np.cos(turn), around * np.sin(turn), z[:, None] + 0 * turn]
    return np.stack(grid, axis=-1).reshape(-1, 3), 2 * np.pi / (heights * azimuths)


@pytest.mark.parametrize("material", MATERIALS, ids=str)
def test_under_a_point_light_it_is_the_shading_equation(material, lobes_of):
    """f cos(theta) times pi; a light of colour 1 at distance 2, k_l d + k_q d^2 being 1 there."""
    specular, shininess = material
    rng = np.random.default_rng(5)
    wi, wo = rng.standard_normal((2, 200, 3))
    wi, wo = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))
    wi[:, 2] = abs(wi[:, 2])
    for one, other in zip(wi, wo, strict=True):
        expected = shade(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), RHO, 2 * other[None],
                         np.ones((1, 3)), np.zeros(3), np.array([0.5, 0.0]), specular, shininess,
                         3 * one)  # fmt: skip
        found, _ = call(lobes_of(material, one), other[None])
        np.testing.assert_allclose(np.pi * found, expected, rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize(
    ("material", "angle"),
    [
        pytest.param(material, angle, marks=[] if i == k else pytest.mark.slow)
        for i, material in enumerate(MATERIALS)
        for k, angle in enumerate(INCIDENT)
    ],
)
def test_directions_come_as_often_as_their_density_says(material, angle, lobes_of):
    """Chi-square over 24 x 16 cells above the surface, and one for those lost below it."""
    lobes = lobes_of(material, toward(angle))
    wo, pdf, weight = drawn(lobes)
    np.testing.assert_allclose(np.linalg.norm(wo, axis=1), 1, atol=1e-5)
    value, again = call(lobes, wo)
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
    share = np.bincount(cell(above), call(lobes, above)[1] * solid, minlength=24 * 16)
    assert share.sum() < 1 + 1e-4
    expected = COUNT * np.append(share, max(0.0, 1 - share.sum()))
    counts = np.append(np.bincount(cell(wo[used]), minlength=24 * 16), (~used).sum())
    many = expected > 8
    counts, expected = (np.append(x[many], x[~many].sum()) for x in (counts, expected))
    enough = expected > 1
    statistic = ((counts - expected)[enough] ** 2 / expected[enough]).sum()
    assert chi2.sf(statistic, enough.sum() - 1) > 1e-4


@pytest.mark.parametrize("material", MATERIALS, ids=str)
def test_samples_weigh_what_the_surface_reflects_and_no_more_than_promised(material, lobes_of):
    specular, shininess = material
    above, solid = hemisphere()
    most = RHO + 2 * specular / (shininess + 1)
    for angle in INCIDENT:
        lobes = lobes_of(material, toward(angle))
        albedo = call(lobes, above)[0].sum(axis=0) * solid
        weights = drawn(lobes)[2]
        error = weights.std(axis=0) / COUNT**0.5
        assert (abs(weights.mean(axis=0) - albedo) < 4.5 * error + 1e-4).all()
        assert (albedo <= most * (1 + 1e-4)).all()
        if angle == 0:
            np.testing.assert_allclose(albedo, most, rtol=2e-4)

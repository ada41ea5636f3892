"""Colours of objects, room and lights, as requested, as stored and as seen."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.stats import kstest

from scenegen.description.specs import DatasetSpec
from scenegen.sampling.scenes import sample_scenes

SPARSE = DatasetSpec(objects=(1, 4), object_radius=(0.03, 0.04), seed=6)


def scenes(spec, count):
    _, found = sample_scenes(spec, range(count), [0] * count)
    return [found.scene(row) for row in range(len(found))]


@pytest.mark.parametrize(
    "settings",
    [
        {"reflectance": (0.9, 0.4, 0.2), "room_reflectance": (0.3, 0.5, 0.7)},
        {"random_reflectance": True},
        {"source": "families", "shapes": ("mug", "cap"), "random_reflectance": True},
    ],
    ids=["two-tone", "albedo", "albedo of models"],
)
def test_under_ambient_light_an_image_shows_the_stored_reflectance(settings, make_rooms, tmp_path):
    path = make_rooms(tmp_path / "x.h5", 4, lights=(0, 0), ambient=(0.25, 0.5, 1.0), objects=(2, 3),
                      image_dtype="float32", specular=(0.5, 0.5), **settings)  # fmt: skip
    with h5py.File(path) as file:
        rho = file["material/reflectance"][:]
        for row, ids in enumerate(file["object_id"][:]):
            expected = rho[row, ids] * [0.25, 0.5, 1.0]
            np.testing.assert_allclose(file["image"][row], expected, rtol=1e-6)
            count = file["object/count"][row]
            assert set(np.unique(ids)) == set(range(count + 1))
            described = json.loads(file["scene"][row])
            assert described["room_reflectance"] == rho[row, 0].tolist()
            assert [o["reflectance"] for o in described["objects"]] == rho[
                row, 1 : 1 + count
            ].tolist()


def test_random_reflectance_is_uniform_and_each_objects_own():
    spec = replace(SPARSE, random_reflectance=True)
    found = np.array([o.reflectance for s in scenes(spec, 200) for o in s.objects])
    assert len(found) > 300
    assert found.min() >= 0.15
    assert found.max() <= 0.95
    for channel in found.T:
        assert kstest(channel, "uniform", (0.15, 0.8)).pvalue > 0.01
    assert len(np.unique(found)) == found.size, "no channel is another's, no object another's"
    assert {s.room_reflectance for s in scenes(spec, 5)} == {spec.room_reflectance}


def test_specular_and_shininess_are_uniform_in_their_ranges_and_independent():
    spec = replace(SPARSE, specular=(0.2, 0.6), shininess=(5.0, 45.0))
    found = np.array([(o.specular, o.shininess) for s in scenes(spec, 200) for o in s.objects])
    assert kstest(found[:, 0], "uniform", (0.2, 0.4)).pvalue > 0.01
    assert kstest(found[:, 1], "uniform", (5, 40)).pvalue > 0.01
    assert abs(np.corrcoef(found.T)[0, 1]) < 4 / len(found) ** 0.5

"""Every preset renders, verifies, shows what it says, and its pixels follow from its file alone."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from verified import checks_of

from scenegen.description.presets import (
    PAPER_VIEWS,
    PATH_SAMPLES,
    PRESETS,
    VIEWS_SHRINK,
    preset_spec,
)
from scenegen.description.specs import DatasetSpec, request_from_json
from scenegen.rooms.make import make_dataset

Array = NDArray[Any]
SMALL = {"height": 40, "width": 48, "min_visible_pixels": 4, "image_dtype": "float32", "seed": 21}
SCENES = 3
# A closed room costs more than all scenes of the other presets: one, with few paths and objects.
INTERIOR = {**SMALL, "height": 24, "width": 32, "spp": 1, "objects": (12, 12)}
PAPER = [name for name, it in PRESETS.items() if not it.kind.interior]


def request(name: str) -> tuple[DatasetSpec, int]:
    """Return what the file of a preset holds, and of how many scenes."""
    settings, scenes = (SMALL, SCENES) if name in PAPER else (INTERIOR, 1)
    return preset_spec(name, **settings), scenes


@pytest.fixture(scope="module")
def preset_file(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return the file of a preset's first scenes, small float images."""
    folder = tmp_path_factory.mktemp("presets")

    def make(name: str) -> Path:
        path = folder / f"{name}.h5"
        if not path.exists():
            make_dataset(path, *request(name))
        return path

    return make


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def shaded_from_file(file: h5py.File, row: int) -> Array:
    """The paper's equation, with Phong's lobe, camera frame, from the datasets and nothing else."""
    depth = file["depth"][row].astype(float)
    normal = unit(file["normal"][row].astype(float))
    matrix = file["camera/world_from_camera"][row]
    half = np.tan(np.radians(file["camera/fov_y_degrees"][row]) / 2)
    height, width = depth.shape
    y = half * (1 - (2 * np.arange(height)[:, None] + 1) / height) + 0 * depth
    x = half * width / height * ((2 * np.arange(width) + 1) / width - 1) + 0 * depth
    point = np.stack([x * depth, y * depth, -depth], axis=-1)
    material = file["object_id"][row].astype(int)
    rho = file["material/reflectance"][row][material]
    specular = file["material/specular"][row][material][..., None]
    shininess = file["material/shininess"][row][material][..., None]
    k_l, k_q = file["light/attenuation"][row]
    total = rho * file["light/ambient"][row]
    to_viewer = unit(-point)
    for j in range(file["light/count"][row]):
        light = matrix[:3, :3].T @ (file["light/position"][row, j] - matrix[:3, 3])
        away = light - point
        d = np.linalg.norm(away, axis=-1, keepdims=True)
        arriving = file["light/color"][row, j] / (k_l * d + k_q * d**2)
        cosine = np.sum(normal * away, axis=-1, keepdims=True) / d
        reflected = 2 * cosine * normal - away / d  # where the light would go on a mirror
        lobe = np.maximum(np.sum(reflected * to_viewer, axis=-1, keepdims=True), 0) ** shininess
        total += np.where(cosine > 0, arriving * (rho * cosine + specular * lobe), 0)
    return np.asarray(total)


@pytest.mark.parametrize("name", PAPER)
def test_images_follow_from_the_file_alone(name: str, preset_file: Callable[[str], Path]) -> None:
    with h5py.File(preset_file(name)) as file:
        for row in range(len(file["image"])):
            assert (file["object_id"][row] >= 0).all()
            error = abs(file["image"][row] - shaded_from_file(file, row)).max()
            assert error < 2e-5, row


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_verified(name: str, preset_file: Callable[[str], Path]) -> None:
    path = preset_file(name)
    checks = checks_of(path)
    assert [check for check in checks if not check.ok] == []
    with h5py.File(path) as file:
        spec = request_from_json(file.attrs["spec"])
        assert (spec, len(file["image"]) // len(spec.views)) == request(name)


def rows_of(path: Path) -> tuple[DatasetSpec, dict[str, Any]]:
    with h5py.File(path) as file:
        found: dict[str, Any] = {}
        file.visititems(lambda name, x: found.update({name: x[:]}) if hasattr(x, "dtype") else None)
        found["names"] = list(file["object/shape"].attrs["names"])
        return request_from_json(file.attrs["spec"]), found


@pytest.mark.parametrize("name", ["shapes-single", "shapenet-single"])
def test_single_objects_have_a_known_class(name: str, preset_file: Callable[[str], Path]) -> None:
    spec, rows = rows_of(preset_file(name))
    assert rows["names"] == list(spec.shapes)
    assert rows["object/count"].tolist() == [1] * SCENES
    assert rows["object/shape"].shape == (SCENES, 1)
    for label, model, text in zip(
        rows["object/shape"][:, 0], rows["object/model"][:, 0], rows["scene"], strict=True
    ):
        (item,) = json.loads(text)["objects"]
        assert item["shape"] == model.decode()
        assert item["shape"].split("/")[0] == rows["names"][label]
        assert ("/" in item["shape"]) == (name == "shapenet-single")


def test_what_presets_promise(preset_file: Callable[[str], Path]) -> None:
    def colors(name: str) -> Array:
        rows = rows_of(preset_file(name))[1]
        shown = [r[1 : 1 + n] for r, n in zip(rows["material/reflectance"], rows["object/count"],
                                               strict=True)]  # fmt: skip
        return np.concatenate(shown)

    household = rows_of(preset_file("shapenet"))[1]
    assert set(household["object/count"]) <= {2, 3, 4}
    furniture = rows_of(preset_file("furniture-256"))[1]
    assert set(furniture["names"]) == {"chair", "table"}
    assert set(furniture["object/count"]) <= {2, 3}
    two = colors("two-tone")
    room = rows_of(preset_file("two-tone"))[1]["material/reflectance"][:, 0]
    assert len(np.unique(two, axis=0)) == len(np.unique(room, axis=0)) == 1
    assert abs(two[0] - room[0]).max() > 0.2
    assert len(np.unique(colors("albedo"), axis=0)) == len(colors("albedo"))
    gloss = rows_of(preset_file("specular"))[1]
    assert gloss["material/specular"][:, 1].min() >= 0.3
    assert not gloss["material/specular"][:, 0].any()
    assert rows_of(preset_file("views"))[1]["view_angle_degrees"][:5].tolist() == [*PAPER_VIEWS]
    assert PAPER_VIEWS == (0, 5, 35, 55, 80)
    assert preset_spec("shapes") == DatasetSpec(min_visible_pixels=49)


@pytest.mark.parametrize("name", PAPER)
def test_what_is_told_goes_on_top_of_a_preset(name: str) -> None:
    spec = preset_spec(name, lights=(0, 7), reflectance=(0.1, 0.2, 0.3), seed=5)
    assert (spec.lights, spec.reflectance, spec.seed) == ((0, 7), (0.1, 0.2, 0.3), 5)
    kept = {k: v for k, v in PRESETS[name].settings.items() if k not in ("lights", "reflectance")}
    if name == "views":
        kept.pop("object_radius", None)
    assert {key: getattr(spec, key) for key in kept} == kept


def test_what_follows_other_settings() -> None:
    """Least pixels the image's size, sizes of objects the views, samples the path tracer, ..."""
    assert preset_spec("shapes", height=100, width=200).min_visible_pixels == 60
    assert preset_spec("shapes", height=8, width=8).min_visible_pixels == 1
    assert preset_spec("shapes", height=100, min_visible_pixels=7).min_visible_pixels == 7
    plain, turned = preset_spec("shapes").object_radius, preset_spec("views").object_radius
    assert turned == tuple(VIEWS_SHRINK * r for r in plain)
    assert preset_spec("shapes", views=(0.0, 5.0)).object_radius == turned
    assert preset_spec("views", object_radius=(0.1, 0.2)).object_radius == (0.1, 0.2)
    assert preset_spec("views", views=(0.0,)).object_radius == plain
    single = PRESETS["shapenet-single"].settings["object_radius"]
    some = preset_spec("shapenet-single", views=(0.0, 9.0)).object_radius
    assert some == tuple(VIEWS_SHRINK * r for r in single)
    assert preset_spec("shapes", shading="path").spp == PATH_SAMPLES
    assert preset_spec("shapes", shading="path", spp=3).spp == 3
    assert preset_spec("shapes").spp == 1
    grey = preset_spec("shapes", reflectance=(0.2, 0.3, 0.4))
    assert grey.room_reflectance == grey.reflectance == (0.2, 0.3, 0.4)
    own = preset_spec("shapes", reflectance=(0.2,) * 3, room_reflectance=(0.9,) * 3)
    assert own.room_reflectance == (0.9,) * 3
    assert preset_spec("shapes", room_reflectance=(0.9,) * 3).reflectance == (0.8,) * 3
    assert preset_spec("specular").room_reflectance == (0.8,) * 3, "only what is told is followed"

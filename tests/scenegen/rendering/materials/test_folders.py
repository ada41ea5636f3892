"""Folders of maps as ambientCG and Poly Haven deliver them."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rendering.materials.folders import check_maps, from_folder, read_maps
from scenegen.rendering.materials.kinds import material
from scenegen.rendering.materials.material import SLOPE_STEPS
from scenegen.rendering.materials.palettes import palette


def save(path, values, size=64):
    path.parent.mkdir(parents=True, exist_ok=True)
    if np.ndim(values) == 1:
        values = np.broadcast_to(np.uint8(values), (size, size, 3))
    Image.fromarray(np.ascontiguousarray(values)).save(path)


def waves(size=64, count=3, deep=0.01):
    """The normal map of waves along u over 0.8 m, (n, n, 3) uint8, and their slopes."""
    u = (np.arange(size) + 0.5) / size * 2 * np.pi * count
    slope = deep * 2 * np.pi * count / 0.8 * np.cos(u)
    normal = np.stack([-slope, 0 * u, np.ones_like(u)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    coded = np.broadcast_to(np.round((normal + 1) * 127.5).astype(np.uint8), (size, size, 3))
    return coded, slope


def slopes_along_u(made):
    first = made.slopes.view(np.int16)[:, ::2]
    return first / (SLOPE_STEPS * made.metres)


@pytest.fixture
def folder(tmp_path):
    normal, _ = waves()
    save(tmp_path / "Wood051" / "Wood051_1K-JPG_Color.png", (188, 128, 64))
    save(tmp_path / "Wood051" / "Wood051_1K-JPG_Roughness.png", (51, 51, 51))
    save(tmp_path / "Wood051" / "Wood051_1K-JPG_NormalGL.png", normal)
    save(tmp_path / "Wood051" / "Wood051_1K-JPG_NormalDX.png", 255 - normal)
    save(tmp_path / "Wood051" / "preview.png", (1, 2, 3), 16)
    textures = tmp_path / "plank_floor_1k.blend" / "textures"
    upper = np.zeros((64, 64, 3), np.uint8)
    upper[:32] = 255
    save(textures / "plank_floor_diff_1k.jpg", upper)
    rough = np.full((64, 64), 32768, np.uint16)
    Image.fromarray(rough).save(textures / "plank_floor_rough_1k.png")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    flat = np.broadcast_to(np.float32([0.5, 0.5, 1.0]), (64, 64, 3)).copy()
    OpenEXR.File(header, {"RGB": flat}).write(str(textures / "plank_floor_nor_gl_1k.exr"))
    return tmp_path


def test_both_ways_of_naming_are_read(folder):
    served = from_folder(folder)
    assert set(served) == {"wood", "door", "floor"}
    wood = read_maps(served["wood"][0])
    np.testing.assert_allclose(wood.base_color[5, 5], [0.5029, 0.2159, 0.0513], atol=1e-3)
    np.testing.assert_allclose(wood.roughness, 0.2, atol=1e-6)
    np.testing.assert_allclose(slopes_along_u(wood)[7], waves()[1], atol=0.01)
    floor = read_maps(served["floor"][0])
    assert floor.base_color[:30].max() < 0.1  # row 0 is the lower edge
    assert floor.base_color[34:].min() > 0.9
    np.testing.assert_allclose(floor.roughness, 0.5, atol=1e-4)
    np.testing.assert_allclose(slopes_along_u(floor), 0.0, atol=1e-3)


def test_kinds_that_the_folder_lacks_are_drawn(folder):
    rng = np.random.default_rng(0)
    room, served = palette(rng), from_folder(folder)
    assert material("wood", rng, room, served) is read_maps(served["wood"][0])
    assert material("fabric", rng, room, served).metres < 0.6


def test_large_maps_are_reduced(tmp_path):
    save(tmp_path / "Fabric001_4K_Color.png", (9, 9, 9), 4096)
    made = read_maps(from_folder(tmp_path)["fabric"][0])
    assert made.base_color.shape == (1024, 1024, 3)


GREY, WIDE = (9, 9, 9), np.zeros((2, 9000, 3), np.uint8)
COLOR, ROUGH = "Wood01_1K_Color.png", "Wood01_1K_Roughness.png"
# Pictures of a folder, by name: a colour and side in pixels, or bytes.
BAD = [
    ({}, SpecError, "colour"),
    ({ROUGH: (GREY,)}, SpecError, "colour"),
    ({"Tiles01_1K_Color.png": (GREY,), ROUGH: (GREY,)}, SpecError, ROUGH),
    ({COLOR: (GREY,), ROUGH: (GREY, 32)}, SpecError, "32 x 32"),
    ({"wood_diff_1k.png": (GREY,), "wood_diff_2k.png": (GREY, 128)}, SpecError, "128 x 128"),
    ({"wood_diff_1k.png": (GREY,), "wood_diff_1k.jpg": (GREY,)}, SpecError, "color"),
    ({"Thing01_1K_Color.png": (GREY,)}, SpecError, "name"),
    ({COLOR: b"\x89PNG\r\n\x1a\n" + b"x" * 99}, FileFormatError, ""),
    (
        {"Wood01_diff_1k.png": (GREY,), "Wood01_nor_gl_1k.exr": b"v/1\x01" + b"x" * 99},
        FileFormatError,
        "",
    ),
    ({COLOR: (WIDE,)}, FileFormatError, "9000"),
]


@pytest.mark.parametrize(("files", "error", "word"), BAD)
def test_bad_folders_are_refused(tmp_path, files, error, word):
    for name, how in files.items():
        if isinstance(how, bytes):
            (tmp_path / name).write_bytes(how)
        else:
            save(tmp_path / name, *how)
    with pytest.raises(error) as caught:
        from_folder(tmp_path)
    assert str(tmp_path) in caught.value.where
    assert word in caught.value.found


@pytest.mark.parametrize("ending", ["png", "jpg"])
def test_maps_that_are_cut_short_are_refused_before_they_are_used(tmp_path, ending):
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    save(tmp_path / f"Wood01_1K_Color.{ending}", noise)
    check_maps(from_folder(tmp_path))
    whole = (tmp_path / f"Wood01_1K_Color.{ending}").read_bytes()
    (tmp_path / f"Wood01_1K_Color.{ending}").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError):
        check_maps(from_folder(tmp_path))

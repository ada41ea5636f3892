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


def without_colours(root):
    save(root / "Wood01_1K_Roughness.png", (9, 9, 9))


def one_without_colour(root):
    save(root / "Tiles01_1K_Color.png", (9, 9, 9))
    save(root / "Wood01_1K_Roughness.png", (9, 9, 9))


def several_sizes(root):
    save(root / "Wood01_1K_Color.png", (9, 9, 9))
    save(root / "Wood01_1K_Roughness.png", (9, 9, 9), 32)


def two_resolutions(root):
    save(root / "wood_diff_1k.png", (9, 9, 9))
    save(root / "wood_diff_2k.png", (9, 9, 9), 128)


def two_formats(root):
    save(root / "wood_diff_1k.png", (9, 9, 9))
    save(root / "wood_diff_1k.jpg", (9, 9, 9))


def nameless(root):
    save(root / "Thing01_1K_Color.png", (9, 9, 9))


def damaged(root):
    (root / "Wood01_1K_Color.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"x" * 99)


def damaged_exr(root):
    save(root / "Wood01_1K_Color.png", (9, 9, 9))
    (root / "Wood01_nor_gl_1k.exr").write_bytes(b"v/1\x01" + b"x" * 99)
    (root / "Wood01_diff_1k.png").write_bytes((root / "Wood01_1K_Color.png").read_bytes())


def too_large(root):
    save(root / "Wood01_1K_Color.png", np.zeros((2, 9000, 3), np.uint8))


def empty(root):
    del root


@pytest.mark.parametrize(
    ("make", "error", "word"),
    [
        (without_colours, SpecError, "colour"),
        (one_without_colour, SpecError, "Wood01_1K_Roughness.png"),
        (several_sizes, SpecError, "32 x 32"),
        (two_resolutions, SpecError, "128 x 128"),
        (two_formats, SpecError, "color"),
        (nameless, SpecError, "name"),
        (damaged, FileFormatError, ""),
        (damaged_exr, FileFormatError, ""),
        (too_large, FileFormatError, "9000"),
        (empty, SpecError, "colour"),
    ],
)
def test_bad_folders_are_refused(tmp_path, make, error, word):
    make(tmp_path)
    with pytest.raises(error) as caught:
        from_folder(tmp_path)
    assert str(tmp_path) in caught.value.where
    assert word in caught.value.found
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("ending", ["png", "jpg"])
def test_maps_that_are_cut_short_are_refused_before_they_are_used(tmp_path, ending):
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    save(tmp_path / f"Wood01_1K_Color.{ending}", noise)
    check_maps(from_folder(tmp_path))
    whole = (tmp_path / f"Wood01_1K_Color.{ending}").read_bytes()
    (tmp_path / f"Wood01_1K_Color.{ending}").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError):
        check_maps(from_folder(tmp_path))

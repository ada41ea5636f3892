"""Pictures of closed rooms: how they are developed, and that they show what the truth says."""

import numpy as np
import pytest
from PIL import Image

from scenegen.camera import Grid
from scenegen.common.errors import FileFormatError
from scenegen.rendering.backend import point_to_llvm
from scenegen.rendering.materials.material import Material
from scenegen.rendering.pictures.development import develop

point_to_llvm()  # before Mitsuba is imported here
RADIANCE = np.random.default_rng(0).gamma(2.0, 0.1, (24, 24, 3))
ALBEDO = np.full((24, 24, 3), 0.5)
INSIDE = np.ones((24, 24), bool)


def test_exposure_takes_out_how_bright_a_scene_is():
    dim, told = develop(RADIANCE, ALBEDO, INSIDE, "uint8", None)
    bright, other = develop(40 * RADIANCE, ALBEDO, INSIDE, "uint8", None)
    np.testing.assert_array_equal(dim, bright)
    np.testing.assert_allclose(other[0], told[0] / 40)
    np.testing.assert_allclose(other[1:], told[1:])


def test_white_balance_moves_light_towards_grey():
    picture, told = develop(RADIANCE * (1.0, 0.7, 0.4), ALBEDO, INSIDE, "uint8", None)
    means = picture.mean(axis=(0, 1))
    assert told[1] < told[2] < told[3]
    assert 1.0 < means[0] / means[2] < 1.5


def test_floating_point_pictures_hold_the_radiance():
    picture, _ = develop(RADIANCE, ALBEDO, INSIDE, "float16", None)
    np.testing.assert_array_equal(picture, RADIANCE.astype(np.float16))


def write_environment(path, values):
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    mitsuba.Bitmap(values.astype(np.float32)).write(str(path))
    return path


def test_surroundings_are_equirectangular_and_of_high_range(tmp_path):
    from scenegen.rendering.pictures.assets import read_environment

    good = write_environment(tmp_path / "good.exr", 3.0 + np.zeros((8, 16, 3)))
    assert read_environment(good).shape == (8, 16, 3)
    square = write_environment(tmp_path / "square.exr", np.ones((8, 8, 3)))
    black = write_environment(tmp_path / "black.exr", np.zeros((8, 16, 3)))
    flat = tmp_path / "flat.png"
    Image.fromarray(np.full((8, 16, 3), 200, np.uint8)).save(flat)
    broken = tmp_path / "broken.exr"
    broken.write_bytes(good.read_bytes()[:60])
    tiny = write_environment(tmp_path / "tiny.exr", np.ones((1, 2, 3)))
    below = np.ones((8, 16, 3))
    below[:4] = 0.0
    dark = write_environment(tmp_path / "below.exr", below)
    for path in (square, black, flat, broken, tiny, dark, tmp_path / "none.exr", tmp_path):
        with pytest.raises(FileFormatError):
            read_environment(path)


FLAT, RGBE = bytes((128, 64, 32, 129)) * 128, b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"
OLD_RUNS = bytes((128, 64, 32, 129, 1, 1, 1, 127))


def test_hdr_files_are_read_from_above_as_rgb(tmp_path):
    from scenegen.rendering.pictures.assets import read_environment

    path = tmp_path / "a.hdr"
    path.write_bytes(RGBE + b"-Y 8 +X 16\n" + FLAT)
    np.testing.assert_allclose(np.divide(*read_environment(path)[0, 0, :2]), 2.0)
    for head, body, word in (
        (RGBE + b"+Y 8 +X 16\n", FLAT, "+Y 8 +X 16"),
        (RGBE + b"-Y 8 -X 16\n", FLAT, "-Y 8 -X 16"),
        (RGBE.replace(b"rgbe", b"xyze") + b"-Y 8 +X 16\n", FLAT, "XYZE"),
        (RGBE + b"-Y 8 +X 16\n", OLD_RUNS, "run"),
        (RGBE + b"-Y 8 +X 16\n", FLAT[:99], ""),
    ):
        path.write_bytes(head + body)
        read_environment.cache_clear()
        with pytest.raises(FileFormatError) as error:
            read_environment(path)
        assert word in error.value.found


def test_large_surroundings_keep_the_light_of_a_small_sun(tmp_path, monkeypatch):
    from scenegen.rendering.pictures import assets

    monkeypatch.setattr(assets, "MOST_COLUMNS", 8)
    sky = np.ones((9, 18, 3))
    sky[1, 4] = 90.0
    made = assets.read_environment(write_environment(tmp_path / "sky.exr", sky))
    assert made.shape == (3, 6, 3)
    np.testing.assert_allclose(made[0, 1] / made[0, 0], (8 + 90) / 9, rtol=1e-5)
    assert made[:1].mean() == pytest.approx(assets.MEAN, rel=1e-5)


REFLECTANCE = 0.5


def radiance_of_floor(lamp=None, sky=0.0, sun=(0.0, 0.0), windows=(), share=0.0, spp=4096):
    """Radiance of a floor at (0.5, 0, 0), seen from above; the sun has a height and irradiance."""
    import drjit as dr
    import mitsuba as mi

    from scenegen.rendering.pictures.closed_rooms import closed_room
    from scenegen.rendering.pictures.lights import lights_of
    from scenegen.rendering.pictures.matter import Matter, Soup, tables_of
    from scenegen.rendering.pictures.paths import Camera, trace_paths
    from scenegen.rendering.pictures.sky import Outside

    mi.set_variant("llvm_ad_rgb")
    corners = [[[-9, 0, -9], [-9, 0, 9], [9, 0, 9]], [[-9, 0, -9], [9, 0, 9], [9, 0, -9]]]
    materials = [Material(np.full(3, REFLECTANCE), 1.0, specular=0.0)]
    if lamp is not None:
        height, half, shine = lamp  # a square that faces down
        a, b, c, d = ([x * half, height, z * half] for x, z in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        corners += [[a, b, c], [a, c, d]]
        materials.append(Material(np.ones(3), 1.0, radiance=(shine,) * 3))
    corners = np.array(corners, float)
    of_face = np.arange(len(corners)) // 2
    normals = np.tile([0.0, 1.0, 0.0], (len(corners), 3, 1))
    matter = Matter(
        Soup(corners, normals, np.zeros((len(corners), 3, 2))), tables_of(materials, of_face)
    )
    radiance = matter.tables.rows[of_face, 12:15]
    up = np.array([np.cos(sun[0]), np.sin(sun[0]), 0.0])
    around = Outside(np.full((8, 16, 3), sky, np.float32), up, np.full(3, sun[1]))
    lights = lights_of(around, windows, corners, radiance, share)
    axes = (mi.Vector3f(*map(float, v)) for v in ((1, 0, 0), (0, 0, -1), (0, 1, 0), (0.5, 1, 0)))
    camera = Camera(*axes, Grid(*map(mi.Float, (2, 2, 1e-4, 1e-4))))
    lanes, each = dr.arange(mi.UInt32, 256), spp // 256
    sums = trace_paths(
        closed_room(matter, lights), camera, mi.Float(lanes % 4), mi.Float(1),
        mi.Float(np.full(2 * spp, 0.5, np.float32)), dr.zeros(mi.UInt32, 256), mi.UInt32(each),
        mi.PCG32(1, mi.UInt64(3), mi.UInt64(lanes)), mi.Float(np.inf),
    )  # fmt: skip
    return float(np.mean(np.asarray(sums.radiance.x))) / each


def test_lamps_light_by_the_square_of_their_distance():
    height, half, shine = 1.5, 0.01, 1000.0
    square = height**2 + 0.5**2
    expected = REFLECTANCE / np.pi * shine * (2 * half) ** 2 * height**2 / square**2
    found = radiance_of_floor(lamp=(height, half, shine), share=1.0)
    assert found == pytest.approx(expected, rel=0.01)
    # A large lamp is found by directions of the floor, too.
    near = radiance_of_floor(lamp=(1.5, 40.0, 1.0), share=1.0, spp=2**16)
    assert near == pytest.approx(REFLECTANCE, rel=0.03)


def test_an_even_sky_lights_alike_with_and_without_windows():
    from scenegen.rendering.pictures.lights import Window

    windows = (Window(True, 2.0, -1.0, 1.5, 0.2, 2.0), Window(False, -3.0, -1.0, 1.0, 0.5, 1.5))
    for some in ((), windows[:1], windows):
        found = radiance_of_floor(sky=2.0, windows=some, spp=2**16)
        assert found == pytest.approx(2.0 * REFLECTANCE, rel=0.02)


def test_the_sun_lights_by_the_cosine():
    found = radiance_of_floor(sun=(np.radians(40), 3.0), spp=2**16)
    assert found == pytest.approx(REFLECTANCE / np.pi * 3.0 * np.sin(np.radians(40)), rel=0.02)


def test_maps_of_rooms_begin_where_single_precision_tells_exactly():
    from scenegen.rendering.pictures.matter import tables_of

    levels = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    sizes = [1, 4200, 3, 4200, 5, 2]  # 4200**2 > 2**24
    materials = [
        Material(np.broadcast_to(np.float32(level), (1 if size < 9 else size, size, 3)), 1.0)
        for level, size in zip(levels, sizes, strict=True)
    ]
    tables = tables_of(materials, np.arange(6))
    first = tables.rows[:, 0].astype(np.int64)
    assert first[-1] > 2**25
    red = np.square((tables.texels[first] & 255) / 255)
    np.testing.assert_allclose(red, levels, atol=0.005)

"""Pictures of closed rooms: how they are developed, and that they show what the truth says."""

import numpy as np
import pytest
from PIL import Image

from scenegen.common.errors import BackendError, FileFormatError, SpecError
from scenegen.description.interiors import Interior, Opening
from scenegen.description.presets import preset_spec
from scenegen.objects.catalogue import objects_of
from scenegen.rendering.backend import point_to_llvm
from scenegen.rendering.packing import pack_arrays
from scenegen.rendering.pictures import denoiser
from scenegen.rendering.pictures.development import develop, tone
from scenegen.rendering.pictures.places import ASSETS
from scenegen.rooms.verify import _same_picture
from scenegen.sampling.proposals import ProposalQueue

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


def test_the_tone_curve_rises_to_white():
    levels = np.linspace(0, 5, 100)[:, None]
    values = tone(levels, 5.0)[:, 0]
    assert values[0] == 0
    assert values[-1] == pytest.approx(1)
    assert (np.diff(values) >= 0).all()


def test_a_missing_denoiser_is_told(monkeypatch):
    monkeypatch.setattr(denoiser, "has_denoiser", lambda: False)
    with pytest.raises(BackendError):
        denoiser.denoised(RADIANCE, ALBEDO, ALBEDO)


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


def test_large_surroundings_keep_the_light_of_a_small_sun(tmp_path, monkeypatch):
    from scenegen.rendering.pictures import assets

    monkeypatch.setattr(assets, "MOST_COLUMNS", 8)
    sky = np.ones((9, 18, 3))
    sky[1, 4] = 90.0
    made = assets.read_environment(write_environment(tmp_path / "sky.exr", sky))
    assert made.shape == (3, 6, 3)
    np.testing.assert_allclose(made[0, 1] / made[0, 0], (8 + 90) / 9, rtol=1e-5)
    assert made[:1].mean() == pytest.approx(assets.MEAN, rel=1e-5)


def test_what_a_file_names_must_be_told():
    from scenegen.rendering.pictures.assets import environment_of, materials_of

    ASSETS.use(None, None)
    spec = preset_spec("interiors", materials="0" * 16, environment="1" * 16)
    for asset in (materials_of, environment_of):
        with pytest.raises(SpecError):
            asset(spec)


@pytest.mark.slow
def test_one_moved_object_changes_the_picture_more_than_noise_does():
    from scenegen.rendering.renderer import launch_fields, trace

    spec = preset_spec("interiors", seed=5, height=96, width=96, spp=8)
    objects = objects_of(spec)
    drawn = ProposalQueue(spec, range(1), objects).take(1, 1)
    batch = pack_arrays(spec, drawn, (0,), objects)
    ids = launch_fields(batch, ("object_id",))()["object_id"][0]
    shown = np.bincount(ids[ids > 0].ravel(), minlength=2)
    names = ("image", "exposure")
    first = trace(batch, names)
    again = trace(batch, names)
    assert all(_same_picture(name, first[name][0], again[name][0]) for name in names)
    batch.world_from_object[0, int(shown.argmax()) - 1, 0, 3] += 0.3
    moved = trace(batch, names)
    assert not _same_picture("image", first["image"][0], moved["image"][0])


def test_windows_are_where_their_openings_are():
    from scenegen.rendering.pictures.tracer import windows_of

    opening = Opening("window", "east", 1.0, 2.5, 0.9, 2.0)
    ((corner, along, up),) = windows_of(Interior((4.0, 2.5, 3.0), (opening,), (), 12.0, 0.0, True))
    assert corner[0] > 4.0
    np.testing.assert_allclose(corner[1:] + along[1:] + up[1:], (2.0, 2.5))

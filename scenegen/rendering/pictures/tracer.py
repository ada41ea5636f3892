"""Path-traced pictures of closed rooms.

Images are traced one at a time, with samples at `pixel_samples.sample_positions`, and a pixel's
samples are added in a fixed order, so that the same command gives the same bytes.
"""

from collections.abc import Sequence
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_size
from scenegen.common.random.seeding import Purpose, item_rng, item_seed
from scenegen.common.records import from_json
from scenegen.description.interiors import Interior
from scenegen.description.specs import InteriorSpec
from scenegen.objects.furniture.room_shell import REVEAL
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.pictures.assets import environment_of, materials_of
from scenegen.rendering.pictures.denoiser import denoised
from scenegen.rendering.pictures.development import develop
from scenegen.rendering.pictures.lights import Lights, Window, lights_of
from scenegen.rendering.pictures.matter import gather_matter
from scenegen.rendering.pictures.paths import Camera, trace_paths
from scenegen.rendering.pictures.sky import SUNLESS, Outside, outside, sun_height
from scenegen.rendering.pictures.surfaces import Surfaces, lobes_at, meet, surfaces_of
from scenegen.rendering.pixel_samples import sample_positions
from scenegen.rendering.tables import upload

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
DAY_SHARE, NIGHT_SHARE = 0.4, 0.9  # of samples of lights, of lamps that are on
BRIGHTEST = 60.0  # radiance that indirect light may add at once, in units of the room's mean
LANES = 2  # of a pixel, at most


def trace_pictures(batch: SceneBatch, names: Sequence[str], variant: str) -> dict[str, Array]:
    """Return pictures, (B, H, W, 3), in the spec's image type, and what else `names` ask for."""
    mi.set_variant(variant)
    found: list[dict[str, Array]] = []
    for b in range(len(batch)):
        if b == 0 or batch.index[b] != batch.index[b - 1]:  # views of a room share it
            room = _lit_room(batch, b)
        found.append(_trace_one(batch, b, room, names))
    return {name: np.stack([one[name] for one in found]) for name in names}


def _lit_room(batch: SceneBatch, b: int) -> tuple[Surfaces, Lights, float]:
    """Return what an image's room holds, its lights, and the mean radiance of its walls."""
    spec = batch.spec
    assert isinstance(spec, InteriorSpec)
    assert batch.interior is not None
    interior = from_json(Interior, batch.interior[b], "interior")
    matter = gather_matter(batch, b, interior.lit, materials_of(spec))
    around = environment_of(spec)
    beyond = outside(interior) if around is None else Outside(around, np.eye(3)[1], np.zeros(3))
    night = sun_height(interior.hour) < SUNLESS
    share = NIGHT_SHARE if night else DAY_SHARE
    radiance = matter.tables.rows[matter.tables.of_face, 12:15]
    lights = lights_of(beyond, windows_of(interior), matter.soup.corners, radiance, share)
    surfaces = surfaces_of(matter, lights.by_area)
    x, y, z = interior.size
    # Of walls that reflect half of the light, the mean radiance in all directions.
    return surfaces, lights, lights.flux / (2 * np.pi * (x * y + y * z + z * x))


def _trace_one(
    batch: SceneBatch, b: int, room: tuple[Surfaces, Lights, float], names: Sequence[str]
) -> dict[str, Array]:
    spec, (surfaces, lights, mean) = batch.spec, room
    assert isinstance(spec, InteriorSpec)
    camera = device_camera(batch, b)
    seed = item_seed(spec.seed, int(batch.index[b]), Purpose.PATHS, int(batch.view[b]))
    places = sample_positions(spec.spp)
    lanes = max(n for n in range(1, LANES + 1) if spec.spp % n == 0)
    index = dr.arange(mi.UInt32, spec.height * spec.width * lanes)
    lane, pixel = index % lanes, index // lanes
    x, y = mi.Float(pixel % spec.width), mi.Float(pixel // spec.width)
    at_once = spec.spp // lanes
    first, last = lane * at_once, (lane + 1) * at_once
    dr.eval(x, y, first, last)  # so that all pictures share a kernel
    sums = trace_paths(
        surfaces, lights, camera, x, y, upload(places), first, last,
        dr.opaque(mi.UInt64, seed), dr.opaque(mi.Float, BRIGHTEST * mean),
    )  # fmt: skip
    planes = [*sums.radiance, *sums.albedo, *sums.normal, sums.hit]
    dr.eval(planes)  # at once: each would trace the paths again
    values = np.stack([np.asarray(plane) for plane in planes], -1)
    values = np.nan_to_num(values).reshape(spec.height, spec.width, lanes, 10)
    pixels = values.sum(axis=2, dtype=np.float64) / spec.spp
    radiance, albedo, normal, hit = np.split(pixels, (3, 6, 9), axis=-1)
    if spec.denoise:
        radiance = np.maximum(denoised(radiance, albedo, normal), 0.0)
    noise = None
    if spec.sensor_noise:
        rng = item_rng(spec.seed, int(batch.index[b]), Purpose.PICTURES, int(batch.view[b]))
        noise = spec.sensor_noise * rng.normal(size=radiance.shape)
    image, exposure = develop(radiance, albedo, hit[..., 0] > 0.5, spec.image_dtype, noise)
    found = {"image": image, "exposure": exposure}
    if "albedo" in names:
        found["albedo"] = _albedo(spec, surfaces, camera)
    return found


def device_camera(batch: SceneBatch, b: int) -> Camera:
    """Return a camera. Its numbers are variables, so that all cameras share a kernel."""
    spec = batch.spec
    size = pixel_size(spec.height, float(batch.fov_y_degrees[b]))
    numbers = [*batch.world_from_camera[b, :3].T.ravel().tolist(), size, spec.width, spec.height]
    values = [dr.opaque(mi.Float, float(number)) for number in numbers]
    return Camera(*(mi.Vector3f(*values[i : i + 3]) for i in (0, 3, 6, 9)), *values[12:])


def _albedo(spec: InteriorSpec, surfaces: Surfaces, camera: Camera) -> Array:
    """Return the base colour where the ray through each pixel's centre hits; NaN for nothing."""
    index = dr.arange(mi.UInt32, spec.height * spec.width)
    d = camera.ray(mi.Float(index % spec.width) + 0.5, mi.Float(index // spec.width) + 0.5)
    found, hit = meet(surfaces, mi.Point3f(camera.origin), d, True)
    color = dr.select(found, lobes_at(surfaces, hit, d).color, dr.nan)
    values = np.stack([np.asarray(v, np.float32) for v in color], -1)
    return values.reshape(spec.height, spec.width, 3)


def windows_of(interior: Interior) -> list[Window]:
    """Return a room's windows, at the outside of its walls."""
    x, _, z = interior.size
    at = {"west": -REVEAL, "east": x + REVEAL, "north": -REVEAL, "south": z + REVEAL}
    return [
        Window(hole.wall in ("west", "east"), at[hole.wall], hole.left, hole.right, hole.bottom,
               hole.top)
        for hole in interior.openings
        if hole.kind == "window"
    ]  # fmt: skip

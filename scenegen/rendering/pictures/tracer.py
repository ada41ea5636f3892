"""Path-traced pictures: of closed rooms one at a time, of the paper's rooms many at once.

Samples are at `pixel_samples.sample_positions`, and a pixel's samples are added in a fixed order,
so that the same command gives the same bytes.
"""

from collections.abc import Sequence
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Grid
from scenegen.common.random.seeding import Purpose, item_rng, item_seed
from scenegen.common.records import from_json
from scenegen.description.interiors import Interior
from scenegen.description.specs import InteriorSpec, Request
from scenegen.objects.catalogue import mesh_to_cast
from scenegen.objects.furniture.room_shell import REVEAL
from scenegen.rendering.drjit_renderer import padded_rays, upload_scenes
from scenegen.rendering.ground_truth import encode_image
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.pictures.assets import environment_of, materials_of
from scenegen.rendering.pictures.closed_rooms import ClosedRoom, closed_room
from scenegen.rendering.pictures.denoiser import denoised
from scenegen.rendering.pictures.development import develop
from scenegen.rendering.pictures.lights import Window, lights_of
from scenegen.rendering.pictures.matter import gather_matter
from scenegen.rendering.pictures.paper_rooms import PaperRooms, with_intensities
from scenegen.rendering.pictures.paths import Camera, Room, Samples, Sphere, trace_paths
from scenegen.rendering.pictures.sky import Outside, outside
from scenegen.rendering.pictures.sun import SUNLESS, sun_height
from scenegen.rendering.pixel_samples import sample_positions
from scenegen.rendering.tables import gather_row, upload

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
DAY_SHARE, NIGHT_SHARE = 0.4, 0.9  # of samples of lights, of lamps that are on
BRIGHTEST = 60.0  # radiance that indirect light may add at once, in units of the room's mean
LANES = 2  # of a pixel, at most


def trace_images(batch: SceneBatch, variant: str) -> Array:
    """Return images of the paper's rooms, (B, H, W, 3), in the spec's image type, at once."""
    mi.set_variant(variant)
    spec, count = batch.spec, len(batch)
    models = [mesh_to_cast(batch.shape_of, x) for x in batch.names if spec.source != "shapes"]
    scenes, cameras = upload_scenes(with_intensities(batch), variant, models, bounced=True)
    pixels, lanes = padded_rays(spec), lanes_of(spec)
    index = dr.arange(mi.UInt32, count * pixels * lanes)
    item, pixel = index // (pixels * lanes), index // lanes % pixels
    row = gather_row(cameras, item, 13)
    right, up, back, origin = (mi.Vector3f(*row[i:12:4]) for i in range(4))
    x, y = (dr.opaque(mi.Float, n) for n in spec.middle)
    grid = Grid(x, y, row[12] * spec.pixel_aspect, row[12])
    camera = Camera(right, up, back, origin, grid)
    seeds = np.array([path_seed(batch, b) for b in range(count)], np.uint64)
    halves = upload(seeds.astype("<u8").view("<u4"), np.uint32)
    low, high = (mi.UInt64(dr.gather(mi.UInt32, halves, 2 * item + i)) for i in range(2))
    seed = low | high << 32
    ahead = mi.PCG32(1, seed, mi.UInt64(pixel + pixels * lanes))  # a stream that no lane has
    even = mi.Vector4f(*(ahead.next_float32() for _ in range(4)))
    rng = mi.PCG32(1, seed, mi.UInt64(index % (pixels * lanes)))
    sums = _sums(spec, PaperRooms(scenes, item), camera, pixel, index % lanes, rng, np.inf, even)
    dr.eval(sums.radiance)
    values = np.stack([np.asarray(plane) for plane in sums.radiance], -1)
    values = values.reshape(count, pixels, lanes, 3)[:, : spec.height * spec.width]
    images = values.sum(axis=2, dtype=np.float64) / spec.spp
    return encode_image(images.reshape(count, spec.height, spec.width, 3), spec.image_dtype)


def trace_pictures(batch: SceneBatch, names: Sequence[str], variant: str) -> dict[str, Array]:
    """Return pictures, (B, H, W, 3), in the spec's image type, and what else `names` ask for."""
    mi.set_variant(variant)
    found: list[dict[str, Array]] = []
    for b in range(len(batch)):
        if b == 0 or batch.index[b] != batch.index[b - 1]:  # views of a room share it
            room, mean = _lit_room(batch, b)
        found.append(_trace_one(batch, b, room, mean, names))
    return {name: np.stack([one[name] for one in found]) for name in names}


def _lit_room(batch: SceneBatch, b: int) -> tuple[ClosedRoom, float]:
    """Return what an image's room holds, with its lights, and the mean radiance of its walls."""
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
    x, y, z = interior.size
    # Of walls that reflect half of the light, the mean radiance in all directions.
    mean = lights.flux / (2 * np.pi * (x * y + y * z + z * x))
    return closed_room(matter, lights), mean


def _trace_one(
    batch: SceneBatch, b: int, room: ClosedRoom, mean: float, names: Sequence[str]
) -> dict[str, Array]:
    spec, lanes = batch.spec, lanes_of(batch.spec)
    assert isinstance(spec, InteriorSpec)
    camera = device_camera(batch, b)
    index = dr.arange(mi.UInt32, spec.height * spec.width * lanes)
    rng = mi.PCG32(1, dr.opaque(mi.UInt64, path_seed(batch, b)), mi.UInt64(index))
    sums = _sums(spec, room, camera, index // lanes, index % lanes, rng, BRIGHTEST * mean)
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
        found["albedo"] = _albedo(spec, room, camera)
    return found


def path_seed(batch: SceneBatch, b: int) -> int:
    """Return the seed of an image's random numbers."""
    return item_seed(batch.spec.seed, int(batch.index[b]), Purpose.PATHS, int(batch.view[b]))


def lanes_of(spec: Request) -> int:
    """Return how many lanes share the samples of a pixel."""
    return max(n for n in range(1, LANES + 1) if spec.spp % n == 0)


def _sums(
    spec: Request, room: Room, camera: Camera, pixel: Any, lane: Any, rng: Any, ceiling: float,
    even: Any = None,
) -> Samples:  # fmt: skip
    """Trace the samples of pixels, of which each lane takes its share."""
    x, y = mi.Float(pixel % spec.width), mi.Float(pixel // spec.width)
    at_once = spec.spp // lanes_of(spec)
    first, last = lane * at_once, (lane + 1) * at_once
    dr.eval(x, y, first, last)  # so that all pictures share a kernel
    places, most = upload(sample_positions(spec.spp)), dr.opaque(mi.Float, ceiling)
    return trace_paths(room, camera, x, y, places, first, last, rng, most, even)


def device_camera(batch: SceneBatch, b: int) -> Camera:
    """Return a camera. Its numbers are variables, so that all cameras share a kernel."""
    spec, lens = batch.spec, batch.lens(b)
    pixels = lens.grid(spec.height, spec.width) if lens.is_flat else Sphere(spec.width, spec.height)
    numbers = [*batch.world_from_camera[b, :3].T.ravel().tolist(), *pixels]
    values = [dr.opaque(mi.Float, float(number)) for number in numbers]
    right, up, back, origin = (mi.Vector3f(*values[i : i + 3]) for i in (0, 3, 6, 9))
    return Camera(right, up, back, origin, type(pixels)(*values[12:]))


def _albedo(spec: InteriorSpec, room: Room, camera: Camera) -> Array:
    """Return the base colour where the ray through each pixel's centre hits; NaN for nothing."""
    index = dr.arange(mi.UInt32, spec.height * spec.width)
    d = camera.ray(mi.Float(index % spec.width) + 0.5, mi.Float(index // spec.width) + 0.5)
    found, hit = room.meet(mi.Point3f(camera.origin), d, True)
    color = dr.select(found, hit.color, dr.nan)
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

"""Path-traced pictures of closed rooms.

Images are traced one at a time, with samples at `pixel_samples.sample_positions`, and a pixel's
samples are added in a fixed order, so that the same command gives the same bytes.
"""

import gc
from collections.abc import Sequence
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_size
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import from_json
from scenegen.description.interiors import Interior
from scenegen.objects.room_shell import REVEAL
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.path_tracing.path_tracer import camera_rays
from scenegen.rendering.pictures.assets import environment_of, materials_of
from scenegen.rendering.pictures.daylight import daylight
from scenegen.rendering.pictures.denoiser import denoised
from scenegen.rendering.pictures.development import develop
from scenegen.rendering.pictures.matter import Matter, Soup, gather_matter
from scenegen.rendering.pictures.matter_bsdf import matter_bsdf
from scenegen.rendering.pictures.sky import SUNLESS, Outside, outside, sun_height
from scenegen.rendering.tables import aligned, unit

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
MAX_DEPTH = 12  # segments of a path; in closed rooms light bounces often
ROULETTE_DEPTH = 5  # segments after which a path may end at random
DAY_WEIGHT, NIGHT_WEIGHT = 0.7, 12.0  # of samples of lamps that are on; that of daylight is 1
BRIGHTEST = 60.0  # radiance of one sample, in units of the mean of its picture


def trace_pictures(batch: SceneBatch, names: Sequence[str], variant: str) -> dict[str, Array]:
    """Return pictures, (B, H, W, 3), in the spec's image type, and what else `names` ask for."""
    mi.set_variant(variant)
    found = []
    for b in range(len(batch)):
        found.append(_trace_one(batch, b, names))
        gc.collect()  # Dr.Jit compiles all materials and lights that there are into a kernel
    return {name: np.stack([one[name] for one in found]) for name in names}


def _trace_one(batch: SceneBatch, b: int, names: Sequence[str]) -> dict[str, Array]:
    assert batch.interior is not None
    spec = batch.spec
    interior = from_json(Interior, batch.interior[b], "interior")
    matter = gather_matter(batch, b, interior.lit, materials_of(spec))
    around = environment_of(spec)
    lights = outside(interior) if around is None else Outside(around, np.eye(3)[1], np.zeros(3))
    scene = _scene(interior, matter, lights)
    integrator = mi.load_dict({
        "type": "path", "max_depth": MAX_DEPTH, "rr_depth": ROULETTE_DEPTH,
    })  # fmt: skip
    pixels = spec.height * spec.width
    camera = _camera(batch, b)
    total = np.zeros((pixels, 10))
    for ray, sampler, count in camera_rays(batch, b, camera):
        radiance, _, _ = integrator.sample(scene, sampler, ray)
        si = scene.ray_intersect(ray)
        hit = si.is_valid()
        albedo = dr.select(hit, si.bsdf().eval_diffuse_reflectance(si, hit), 1)
        normal = dr.select(hit, si.sh_frame.n, 0)
        planes = [*radiance, *albedo, *normal, dr.select(hit, mi.Float(1), 0)]
        dr.eval(planes)  # at once: each would trace the paths again
        values = np.stack([np.asarray(plane, np.float32) for plane in planes], -1)
        values[:, :3] = np.minimum(np.nan_to_num(values[:, :3]), _ceiling(values[:, :3]))
        total += values.reshape(pixels, count, 10).sum(axis=1, dtype=np.float64)
    mean = (total / spec.spp).reshape(spec.height, spec.width, 10)
    radiance, albedo, normal, hit = np.split(mean, (3, 6, 9), axis=-1)
    if spec.denoise:
        radiance = np.maximum(denoised(radiance, albedo, normal), 0.0)
    noise = None
    if spec.sensor_noise:
        rng = item_rng(spec.seed, int(batch.index[b]), Purpose.PICTURES, int(batch.view[b]))
        noise = spec.sensor_noise * rng.normal(size=radiance.shape)
    image, exposure = develop(radiance, albedo, hit[..., 0] > 0.5, spec.image_dtype, noise)
    found = {"image": image, "exposure": exposure}
    if "albedo" in names:
        found["albedo"] = _albedo(batch, scene, camera)
    return found


def _camera(batch: SceneBatch, b: int) -> tuple[Any, ...]:
    """Return right, up, back and position of a camera, and the size of a pixel at depth 1.

    They are variables, so that all cameras share a kernel.
    """
    size = pixel_size(batch.spec.height, float(batch.fov_y_degrees[b]))
    numbers = [*batch.world_from_camera[b, :3].T.ravel().tolist(), size]
    values = [dr.opaque(mi.Float, float(number)) for number in numbers]
    return *(mi.Vector3f(*values[i : i + 3]) for i in (0, 3, 6, 9)), values[12]


def _ceiling(radiance: Array) -> float:
    """Return the radiance at which single samples are cut, as few of them make bright specks."""
    return BRIGHTEST * max(float(radiance.mean()), 1e-9)


def _albedo(batch: SceneBatch, scene: Any, camera: Any) -> Array:
    """Return the base colour where the ray through each pixel's centre hits; NaN for nothing."""
    spec = batch.spec
    right, up, back, origin, size = camera
    index = dr.arange(mi.UInt32, spec.height * spec.width)
    x = mi.Float(index % spec.width) + 0.5
    y = mi.Float(index // spec.width) + 0.5
    d = right * ((x - spec.width / 2) * size) + up * ((spec.height / 2 - y) * size) - back
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(origin), unit(d)))
    color = dr.select(si.is_valid(), si.bsdf().eval_diffuse_reflectance(si), dr.nan)
    values = np.stack([np.asarray(v, np.float32) for v in color], -1)
    return values.reshape(spec.height, spec.width, 3)


def _scene(interior: Interior, matter: Matter, lights: Outside) -> Any:
    """Return the scene, of the same form for all rooms."""
    night = sun_height(interior.hour) < SUNLESS
    weight = (NIGHT_WEIGHT if night else DAY_WEIGHT) if interior.lit else 1e-3
    contents: dict[str, Any] = {
        "type": "scene",
        "matter": _mesh("matter", matter.soup, bsdf=matter_bsdf(matter.tables)),
        "glow": _mesh("glow", matter.glowing, radiance=matter.radiance, weight=weight),
        "day": daylight(lights, windows_of(interior)),
    }
    return mi.load_dict(contents)


def windows_of(interior: Interior) -> Array:
    """Return corner and two edges of each window at the outside of its wall, (N, 3, 3)."""
    x, _, z = interior.size
    found = []
    for hole in interior.openings:
        if hole.kind != "window":
            continue
        wide, tall = hole.right - hole.left, hole.top - hole.bottom
        along_z = hole.wall in ("west", "east")
        across = {"west": -REVEAL, "east": x + REVEAL, "north": -REVEAL, "south": z + REVEAL}
        at = across[hole.wall]
        corner = (at, hole.bottom, hole.left) if along_z else (hole.left, hole.bottom, at)
        edge = (0, 0, wide) if along_z else (wide, 0, 0)
        found.append((corner, edge, (0, tall, 0)))
    return np.array(found, np.float64).reshape(-1, 3, 3)


def _mesh(
    name: str, soup: Soup, bsdf: Any = None, radiance: Array | None = None, weight: float = 1.0
) -> Any:
    count = len(soup.corners)
    properties = mi.Properties()
    if bsdf is not None:
        properties["bsdf"] = bsdf
    if radiance is not None:
        shines = {
            "type": "area",
            "radiance": {"type": "mesh_attribute", "name": "face_radiance"},
            "sampling_weight": weight,  # that of daylight is 1
        }
        properties["emitter"] = mi.load_dict(shines)
    mesh = mi.Mesh(
        name, 3 * count, count, properties, has_vertex_normals=True, has_vertex_texcoords=True
    )
    if radiance is not None:
        mesh.add_attribute("face_radiance", 3, aligned(radiance))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = aligned(soup.corners)
    parameters["vertex_normals"] = aligned(soup.normals)
    parameters["vertex_texcoords"] = aligned(soup.uv)
    parameters["faces"] = aligned(np.arange(3 * count), np.uint32)
    parameters.update()
    return mesh

"""Path-traced images, for `--shading path`: shadows and indirect light, by Mitsuba.

Only the colour is computed here; depth, normals and ids are those of `drjit_renderer`, bit for bit.
Scenes are traced one at a time, with samples at `pixel_samples.sample_positions`, and a pixel's
samples are added in a fixed order, so that the same command gives the same bytes.

A point light of colour L in the shading equation becomes one of intensity
pi L D^2 / (k_l D + k_q D^2), where D is its distance from the camera's target, so that it is as
bright there as by the shading equation. Ambient light becomes an environment of that radiance.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_size
from scenegen.common.random.seeding import Purpose, item_seed
from scenegen.description.specs import DatasetSpec
from scenegen.objects.scene_mesh import room_mesh
from scenegen.rendering.ground_truth import encode_image
from scenegen.rendering.meshes.unit_scene import triangle_mesh
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.path_tracing.phong_material import phong_bsdf
from scenegen.rendering.pixel_samples import sample_positions
from scenegen.rendering.tables import unit, upload

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
MAX_DEPTH = 8  # segments of a path; direct light needs 2
RAYS_AT_ONCE = 2**21
LEAST_WEIGHT = 1e-3  # least sampling weight of a light


def trace_images(batch: SceneBatch, variant: str) -> Array:
    """Return the images of a batch, (B, H, W, 3), in the spec's image type."""
    mi.set_variant(variant)
    integrator = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH, "hide_emitters": True})
    images = [_trace_one(batch, b, integrator) for b in range(len(batch))]
    return encode_image(np.stack(images), batch.spec.image_dtype)


def _trace_one(batch: SceneBatch, b: int, integrator: Any) -> Array:
    spec = batch.spec
    scene = _scene(batch, b)
    pixels = spec.height * spec.width
    axes = (mi.Vector3f(*v) for v in batch.world_from_camera[b, :3].T.tolist())
    camera = (*axes, pixel_size(spec.height, float(batch.fov_y_degrees[b])))
    total = np.zeros((pixels, 3))
    for ray, sampler, count in camera_rays(batch, b, camera):
        radiance, valid, _ = integrator.sample(scene, sampler, ray)
        radiance = dr.select(valid, radiance, mi.Color3f(*batch.background[b].tolist()))
        values = np.asarray(dr.ravel(radiance), np.float64)
        total += values.reshape(pixels, count, 3).sum(axis=1)
    return (total / spec.spp).reshape(spec.height, spec.width, 3)


def camera_rays(batch: SceneBatch, b: int, camera: Sequence[Any]) -> Iterator[tuple[Any, Any, int]]:
    """Yield rays through the samples of all pixels, some samples at a time, with their sampler.

    The last number is that of the samples of each pixel, which lie beside each other.

    Args:
        camera: right, up and back in the world, the position, and the size of a pixel at depth 1.
    """
    spec, (right, up, back, origin, size) = batch.spec, camera
    pixels, places = spec.height * spec.width, sample_positions(spec.spp)
    at_once = max(1, RAYS_AT_ONCE // pixels)
    for number, start in enumerate(range(0, spec.spp, at_once)):
        positions = places[start : start + at_once]
        count = len(positions)
        # Multi-jittered samples are less noisy, but need a count that fills a rectangle.
        kind = "independent" if count % math.isqrt(count) else "multijitter"
        sampler = mi.load_dict({"type": kind, "sample_count": count})
        sampler.set_samples_per_wavefront(count)
        # Mitsuba keys the numbers of pixel p by count * p + seed: with neighbouring seeds, one pass
        # would repeat those of another for a pixel nearby.
        stream = number * len(spec.views) + int(batch.view[b])
        seed = item_seed(spec.seed, int(batch.index[b]), Purpose.PATHS, stream)
        sampler.seed(seed, pixels * count)
        index = dr.arange(mi.UInt32, pixels * count)
        pixel, sample = index // count, index % count
        across, down = (dr.gather(mi.Float, upload(axis), sample) for axis in positions.T)
        x, y = mi.Float(pixel % spec.width) + across, mi.Float(pixel // spec.width) + down
        d = right * ((x - spec.width / 2) * size) + up * ((spec.height / 2 - y) * size) - back
        yield mi.RayDifferential3f(mi.Point3f(origin), unit(d)), sampler, count


def _scene(batch: SceneBatch, b: int) -> Any:
    contents: dict[str, Any] = {
        "type": "scene",
        "ambient": {
            "type": "constant",
            "radiance": _rgb(batch.ambient[b]),
            "sampling_weight": float(batch.ambient[b].mean()) + LEAST_WEIGHT,
        },
    }
    if batch.has_room[b]:
        corners = np.asarray(room_mesh().triangles)
        contents["room"] = triangle_mesh("room", corners, bsdf=_bsdf(batch, b, 0))
    for k in range(int(batch.object_count[b])):
        shape = batch.shape_of(batch.names[batch.shape[b, k]])
        placed, bsdf = batch.world_from_object[b, k], _bsdf(batch, b, k + 1)
        if shape.is_sphere:
            contents[f"object{k}"] = {
                "type": "sphere",
                "center": placed[:3, 3].tolist(),
                "radius": float(batch.object_scale[b, k]),
                "bsdf": bsdf,
            }
            continue
        triangles = shape.triangles @ placed[:3, :3].T + placed[:3, 3]
        normals = shape.normals @ (placed[:3, :3] / batch.object_scale[b, k]).T
        contents[f"object{k}"] = triangle_mesh(f"object{k}", triangles, normals, bsdf)
    k_l, k_q = batch.attenuation[b].tolist()
    assert isinstance(batch.spec, DatasetSpec)
    for j in range(int(batch.light_count[b])):
        distance = float(np.linalg.norm(batch.light_position[b, j] - batch.spec.camera_target))
        scale = np.pi * distance / (k_l + k_q * distance)
        brightness = batch.light_color[b, j].mean() * scale / (np.pi * distance**2)
        contents[f"light{j}"] = {
            "type": "point",
            "position": batch.light_position[b, j].tolist(),
            "intensity": _rgb(batch.light_color[b, j] * scale),
            "sampling_weight": float(brightness) + LEAST_WEIGHT,
        }
    return mi.load_dict(contents)


def _bsdf(batch: SceneBatch, b: int, object_id: int) -> Any:
    reflectance = batch.reflectance[b, object_id]
    specular, shininess = batch.gloss[b, object_id].tolist()
    if specular > 0:
        return phong_bsdf(reflectance, specular, shininess)
    matte = {"type": "diffuse", "reflectance": _rgb(reflectance)}
    return mi.load_dict({"type": "twosided", "bsdf": matte})


def _rgb(color: Array) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(c) for c in color]}

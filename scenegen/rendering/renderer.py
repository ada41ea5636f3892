"""Render a batch of scenes on the best backend: the entry point of this folder."""

from collections.abc import Callable, Collection, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.cgroup import processors
from scenegen.common.errors import BackendError
from scenegen.description.specs import Request
from scenegen.objects.catalogue import face_count
from scenegen.objects.solids import UnitShape
from scenegen.rendering.backend import HOW_TO_GET_LLVM, select_variant
from scenegen.rendering.ground_truth import GroundTruth
from scenegen.rendering.numpy_renderer import render_in_numpy, smooth_normals
from scenegen.rendering.packing import SceneBatch
from scenegen.rendering.shells import with_shells, without_shells
from scenegen.rendering.surfaces.in_numpy import cast_at_surface

Array = NDArray[Any]
PICTURE = ("image", "exposure", "albedo")  # fields that depend on materials
MOST_WORKERS = 16  # that are used unasked; each takes about 0.4 GiB
MOST_ON_GPU = 4  # the same on a GPU, of whose memory each takes a share, too
WORTHWHILE = 2000  # images for each worker; below, starting it takes longer than it saves
MOST_FACES = 2_000_000  # of the models of one launch; the rasteriser takes 96 bytes a face
MOST_DRAWN = 8_000_000  # faces that the images of one launch show; it takes some 16 bytes for each
MOST_PATHS = 2**23  # traced in one launch, of several images; they take seconds
MOST_MODELS = 2000  # in one Mitsuba scene; must not exceed `model_scene.MOST_MODELS`


def useful_workers(images: int, variant: str, worthwhile: int = WORTHWHILE) -> int:
    """Return how many processes should render so many images.

    One for each processor, as far as each has enough to do, `worthwhile` images. Several share a
    GPU, which waits for one.
    """
    most = MOST_ON_GPU if variant == "cuda_ad_rgb" else MOST_WORKERS
    return max(1, min(processors(), most, images // worthwhile))


def share_processors(workers: int, device: str = "auto") -> None:
    """Let the CPU variant use one of `workers` equal shares of the processors, at least one.

    Raises BackendError as `render`.
    """
    if select_variant(device) == "llvm_ad_rgb":
        import drjit

        drjit.set_thread_count(max(1, processors() // workers))


def render(batch: SceneBatch, device: str = "auto") -> GroundTruth:
    """Render a batch and wait for it. Raises BackendError if `device` cannot be used."""
    return launch(batch, device)()


def launch(batch: SceneBatch, device: str = "auto") -> Callable[[], GroundTruth]:
    """Start to render a batch; the returned function waits for the pixels and returns them.

    The caller can do other work in between. The scalar fallback does all its work in the second
    call.
    """
    names = truth_fields(batch.spec) + picture_fields(batch.spec)
    fetch = launch_fields(batch, names, device)
    return lambda: GroundTruth(**fetch())


def truth_fields(spec: Request) -> list[str]:
    """Return the fields of `GroundTruth` that come from the ray through each pixel's centre."""
    own = ["albedo"] if spec.own_reflectance else []
    return ["depth", "normal", "object_id", *own]


def picture_fields(spec: Request) -> list[str]:
    """Return the other ones, which path tracing computes for pictures."""
    if not spec.interior:
        return ["image"]
    return [name for name in PICTURE if name != "albedo" or "albedo" in spec.truth]


def launch_fields(
    batch: SceneBatch, names: Sequence[str], device: str = "auto", kept: Collection[str] = ()
) -> Callable[[], dict[str, Array]]:
    """Start to render some fields of `GroundTruth`; the others are not computed. See `launch`.

    Of the fields that are `kept`, nothing is fetched but object ids. They stay on the device: a
    `device_pixels.DeviceImage` for each image, under its name after
    `ground_truth.KEPT`. Path tracing and the scalar variant keep none.
    """
    variant = select_variant(device)
    pictures = [name for name in names if name in PICTURE]
    if batch.spec.shading == "path" and pictures:
        fetch_truth = launch_fields(batch, [x for x in names if x not in PICTURE], device)
        return lambda: {**fetch_truth(), **trace(batch, pictures, device)}
    if batch.interior is not None and batch.has_room.any():
        fetch_shell = launch_fields(with_shells(batch), names, device)
        return lambda: without_shells(fetch_shell(), batch.spec)
    if variant == "scalar_rgb":
        if batch.spec.own_reflectance:
            raise BackendError("own reflectance", "no LLVM", hint=HOW_TO_GET_LLVM)

        def cast(name: str, origins: Array, directions: Array) -> tuple[Array, Array]:
            return _scalar_cast(batch.shape_of(name), origins, directions)

        def fetch() -> dict[str, Array]:
            truth = render_in_numpy(batch, cast)
            return {name: getattr(truth, name) for name in names}

        return fetch
    from scenegen.rendering.drjit_renderer import launch_pixels  # imports drjit; not needed above

    first, *others = parts(batch)
    fetch_first = launch_pixels(first, variant, names, kept)
    if not others:
        return fetch_first

    def fetch_all() -> dict[str, Array]:
        pixels = [fetch_first()]
        pixels += [launch_pixels(part, variant, names, kept)() for part in others]
        return {name: np.concatenate([part[name] for part in pixels]) for name in pixels[0]}

    return fetch_all


def stacked(images: Sequence[Any], shape: tuple[int, ...]) -> Any:
    """Return images that stayed on the device as one tensor: see `device_pixels.stacked`."""
    from scenegen.rendering import device_pixels  # imports drjit, as above

    return device_pixels.stacked(images, shape)


def trace(batch: SceneBatch, names: Sequence[str], device: str = "auto") -> dict[str, Array]:
    """Return the path-traced fields of `GroundTruth`, some of PICTURE. Raises BackendError."""
    variant = select_variant(device)
    if variant == "scalar_rgb":
        raise BackendError("shading path", "no LLVM", hint=HOW_TO_GET_LLVM)
    from scenegen.rendering.pictures import tracer  # imports drjit, as above

    if batch.spec.interior:
        return tracer.trace_pictures(batch, names, variant)
    many = traced_at_once(batch.spec)
    images = [
        tracer.trace_images(part.rows(slice(start, start + many)), variant)
        for part in parts(batch)
        for start in range(0, len(part), many)
    ]
    return {"image": np.concatenate(images)}


def traced_at_once(spec: Request) -> int:
    """Return how many images should be traced in one go."""
    views = len(spec.view_angles)
    at_once = 1 if spec.interior else MOST_PATHS // (spec.height * spec.width * spec.spp * views)
    return max(1, at_once) * views


def parts(batch: SceneBatch) -> list[SceneBatch]:
    """Cut a batch such that no part has too many faces, of its models or shown by its images.

    An image's bits do not depend on the rest of its batch, so this changes no pixel.
    """
    if batch.spec.source == "shapes":
        return [batch]
    faces = np.array([face_count(batch.shape_of, name) for name in batch.names])
    starts, seen, drawn = [0], set[int](), 0
    for row, shapes in enumerate(batch.shape):
        shown = shapes[shapes >= 0].tolist()
        seen |= set(shown)
        drawn += int(faces[shown].sum())
        many = len(seen) > MOST_MODELS or faces[list(seen)].sum() > MOST_FACES
        if (many or drawn > MOST_DRAWN) and row > starts[-1]:
            starts.append(row)
            seen, drawn = set(shown), int(faces[shown].sum())
    ends = [*starts[1:], len(batch)]
    return [batch.rows(slice(start, end)) for start, end in zip(starts, ends, strict=True)]


@lru_cache(maxsize=64)
def _scalar_scene(shape: UnitShape) -> Any:
    import mitsuba as mi

    from scenegen.rendering.meshes.unit_scene import mitsuba_shape

    mi.set_variant("scalar_rgb")
    return mi.load_dict({"type": "scene", "shape": mitsuba_shape(shape, np.zeros(3))})


def _scalar_cast(shape: UnitShape, origins: Array, directions: Array) -> tuple[Array, Array]:
    """Cast rays as a `numpy_renderer.Cast`: at meshes one by one, with Mitsuba's scalar variant."""
    if shape.surface is not None:
        t, normals = cast_at_surface(shape.surface, origins, directions)
        behind = np.einsum("ri,ri->r", normals, directions) > 0  # seen from inside
        return t, np.where(behind[:, None], -normals, normals)
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    scene = _scalar_scene(shape)
    t = np.full(len(origins), np.inf)
    triangle = np.zeros(len(origins), np.int64)
    u, v = np.zeros((2, len(origins)))
    rays = zip(origins.tolist(), directions.tolist(), strict=True)
    for i, (origin, direction) in enumerate(rays):
        hit = scene.ray_intersect_preliminary(mi.Ray3f(origin, direction), False)
        if hit.is_valid():
            t[i], triangle[i] = hit.t, hit.prim_index
            u[i], v[i] = hit.prim_uv
    return t, smooth_normals(shape, triangle, u, v, directions)

"""Batches of scenes -> images with exact ground truth, on the best backend there is."""

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.backend import select_variant
from scenegen.packing import SceneBatch
from scenegen.reference import face_viewer, render_reference, smooth_normals
from scenegen.shapes import unit_shape
from scenegen.truth import GroundTruth

Array = NDArray[Any]


def render(batch: SceneBatch, device: str = "auto") -> GroundTruth:
    """Render a batch and wait for it. Raises BackendError where `device` cannot be used."""
    return launch(batch, device)()


def launch(batch: SceneBatch, device: str = "auto") -> Callable[[], GroundTruth]:
    """Start to render a batch; the returned function waits for the pixels and returns them.

    Between the two calls the caller's thread is free, except on the scalar fallback, which does
    its work in the second.
    """
    fetch = launch_fields(batch, tuple(field.name for field in fields(GroundTruth)), device)
    return lambda: GroundTruth(**fetch())


def launch_fields(
    batch: SceneBatch, names: Sequence[str], device: str = "auto"
) -> Callable[[], dict[str, Array]]:
    """As `launch`, for some fields of `GroundTruth` by name; the others cost nothing."""
    variant = select_variant(device)
    if variant == "scalar_rgb":

        def fetch() -> dict[str, Array]:
            truth = render_reference(batch, _scalar_cast)
            return {name: getattr(truth, name) for name in names}

        return fetch
    from scenegen.wavefront import launch_wavefront  # imports drjit, which no other path needs

    return launch_wavefront(batch, variant, names)


@cache
def _scalar_scene(name: str) -> Any:
    import mitsuba as mi

    from scenegen.unit_scene import mitsuba_shape

    mi.set_variant("scalar_rgb")
    shape = unit_shape(name)
    return mi.load_dict({"type": "scene", "shape": mitsuba_shape(shape, np.zeros(3))})


def _scalar_cast(name: str, origins: Array, directions: Array) -> tuple[Array, Array]:
    """Cast rays one by one (a `reference.Cast`); slow, but there wherever Mitsuba is."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    scene = _scalar_scene(name)
    t = np.full(len(origins), np.inf)
    triangle, u, v = (
        np.zeros(len(origins), np.int64),
        np.zeros(len(origins)),
        np.zeros(len(origins)),
    )
    for i, (origin, direction) in enumerate(
        zip(origins.tolist(), directions.tolist(), strict=True)
    ):
        hit = scene.ray_intersect_preliminary(mi.Ray3f(origin, direction), False)
        if hit.is_valid():
            t[i], triangle[i] = hit.t, hit.prim_index
            u[i], v[i] = hit.prim_uv
    if not unit_shape(name).is_sphere:
        return t, smooth_normals(name, triangle, u, v, directions)
    points = origins + np.where(np.isfinite(t), t, 0.0)[:, None] * directions
    return t, face_viewer(points / np.linalg.norm(points, axis=1, keepdims=True), directions)

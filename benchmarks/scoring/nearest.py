"""Milliseconds a pair of the scorer's nearest neighbours both ways, on rooms and predictions.

    python -m benchmarks.scoring.nearest [--sizes 128 256] [--rounds 5]

Ours starts from the depth images; the others are given the points. "error" is the largest
difference of any method from scipy in double precision.
"""

import argparse
import importlib.util
import statistics
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import repeat
from metrics.measures.surfaces.chamfer_hausdorff import NearestDistances, nearest_distances
from metrics.measures.surfaces.image_search import nearest_distances_on_image
from scenegen.camera import back_project
from scenegen.description.presets import preset_spec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render
from scenegen.sampling.scenes import sample_scene

Array = NDArray[np.float64]
Method = Callable[[Array, Array], NearestDistances]
FOV = 28.0  # of the preset


def room_depth(size: int) -> Array:
    """Return the planar depth (size, size) of a room of basic shapes."""
    spec = preset_spec("shapes", height=size, width=size)
    found = (sample_scene(spec, i) for i in count())
    scene = next(scene for scene in found if scene is not None)
    return render(pack(spec, [scene])).depth[0].astype(np.float64)


def predictions(truth: Array, seed: int) -> Iterator[tuple[str, Array]]:
    """Yield names and predictions of a true depth image, good ones first."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[: truth.shape[0], : truth.shape[1]] / truth.shape[0]
    wave = np.sin(5.0 * column + 1.0) * np.cos(4.0 * row)
    noise = rng.standard_normal(truth.shape)
    wild = np.where(rng.random(truth.shape) < 0.01, rng.uniform(2.0, 3.0, truth.shape), truth)
    yield "good: smooth 0.2%", truth * (1.0 + 0.002 * wave)
    yield "good: smooth 0.5%", truth * (1.0 + 0.005 * wave)
    yield "good: smooth 0.5%, 1% pixels wild", wild * (1.0 + 0.005 * wave)
    yield "good: noise 1%", truth * (1.0 + 0.01 * noise)
    yield "good: smooth 0.5%, noise 1%", truth * (1.0 + 0.005 * wave) * (1.0 + 0.01 * noise)
    yield "fair: smooth 2%", truth * (1.0 + 0.02 * wave)
    yield "bad: flat", np.full_like(truth, np.nanmean(truth))
    yield "bad: scale 1.1", truth * 1.1
    yield "bad: scale 0.5", truth * 0.5
    yield "bad: scale 1000", truth * 1000.0
    yield "bad: noise 5%", truth * (1.0 + 0.05 * noise)
    yield "bad: uniform noise", rng.uniform(1.0, 4.0, truth.shape)


def installed_methods() -> dict[str, Method]:
    """Return the installed methods to compare with, by name."""
    methods: dict[str, Method] = {}
    if importlib.util.find_spec("pykdtree"):
        methods["pykdtree"] = partial(nearest_distances, backend="pykdtree")
    methods["scipy"] = partial(nearest_distances, backend="scipy")
    if importlib.util.find_spec("point_cloud_utils"):
        methods["pcu"] = _point_cloud_utils
    return methods


def _point_cloud_utils(a: Array, b: Array) -> NearestDistances:
    import point_cloud_utils

    search = partial(point_cloud_utils.k_nearest_neighbors, k=1, num_threads=0)
    return NearestDistances(search(a, b)[0].ravel(), search(b, a)[0].ravel())


def largest_difference(a: NearestDistances, b: NearestDistances) -> float:
    """Return the largest difference between two results for one pair of clouds."""
    return float(max(np.abs(a.forward - b.forward).max(), np.abs(a.reverse - b.reverse).max()))


def bench_pair(predicted: Array, truth: Array, rounds: int) -> tuple[list[float], float]:
    """Return milliseconds of ours and of each method, and the largest difference from scipy."""
    inside = np.isfinite(truth)
    a, b = (back_project(depth, FOV)[inside] for depth in (predicted, truth))
    runs: list[Callable[[], NearestDistances]] = [
        partial(nearest_distances_on_image, predicted, truth, FOV),
        *(partial(method, a, b) for method in installed_methods().values()),
    ]
    expected = nearest_distances(a, b, "scipy")
    error = max(largest_difference(run(), expected) for run in runs)
    return [1e3 * statistics.median(repeat(run, rounds)) for run in runs], error


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[128, 256])
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    names = ["ours", *installed_methods()]
    print(f"{'size  prediction':40s}", *(f"{name:>9s}" for name in names), "    error")
    for size in arguments.sizes:
        truth = room_depth(size)
        for name, predicted in predictions(truth, seed=1):
            times, error = bench_pair(predicted, truth, arguments.rounds)
            cells = " ".join(f"{value:9.2f}" for value in times)
            print(f"{size:4d}  {name:34s} {cells}   {error:.1e}", flush=True)


if __name__ == "__main__":
    main()

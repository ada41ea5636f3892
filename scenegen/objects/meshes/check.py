"""Try every model of a folder: which can be used, what was mended, why others are refused."""

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from scenegen.files.pool import LostWorkerError, worker_pool
from scenegen.objects.cache import DiskCache
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.listing import ModelFile, ModelFolder
from scenegen.objects.meshes.models import load_model

# These count as mended; seams and unused vertices do not, as most files have some.
DEFECTS = ("faces_out_of_range", "faces_not_finite", "degenerate_faces", "double_faces")


@dataclass(frozen=True)
class ModelCheck:
    """The result of trying one model.

    Attributes:
        name: "class/id".
        reason: why it cannot be used; empty if it can.
        faces: number of triangles after cleaning.
        mended: counts as in `CleanMesh.mended`.
        seconds: time to read and clean it, or to load it from the cache.
    """

    name: str
    ok: bool
    reason: str
    faces: int
    mended: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def was_mended(self) -> bool:
        """Whether faces had to be removed."""
        return any(self.mended.get(name, 0) for name in DEFECTS)


def check_models(
    folder: ModelFolder,
    cache_dir: str | Path | None,
    jobs: int = 1,
    progress: Callable[[int], object] | None = None,
) -> list[ModelCheck]:
    """Load every model, cleaning those that are not in the cache yet.

    Args:
        cache_dir: folder of the cache of cleaned models; None for no cache.
        jobs: number of processes. With more than one, a model that crashes its process is refused.
        progress: called with 1 after each model.

    Returns:
        One record per model, in the order of the listing.

    Raises:
        SceneGenError: with more than one job, if processes cannot be started.
    """
    files = [file for name in folder.classes for file in folder.models[name]]
    cache = DiskCache(cache_dir)
    cache.check_folder()
    records: Iterator[ModelCheck] = (_check(file, folder.up, cache) for file in files)
    if jobs > 1 and len(files) > 1:
        records = _in_processes(files, folder.up, cache.folder, jobs)
    by_name = {}
    for record in records:
        by_name[record.name] = record
        if progress:
            progress(1)
    return [by_name[file.name] for file in files]


def _check(file: ModelFile, up: str, cache: DiskCache) -> ModelCheck:
    started = time.perf_counter()
    try:
        model = load_model(file.path, up, cache)
    except BadMeshError as error:
        return ModelCheck(file.name, False, str(error), 0, {}, time.perf_counter() - started)
    seconds = time.perf_counter() - started
    return ModelCheck(file.name, True, "", len(model.faces), model.mended, seconds)


def _check_in_worker(up: str, cache_dir: Path | None, file: ModelFile) -> ModelCheck:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the caller has already warned about the cache
        return _check(file, up, DiskCache(cache_dir))


def _in_processes(
    files: Sequence[ModelFile], up: str, cache_dir: Path | None, jobs: int
) -> Iterator[ModelCheck]:
    """Check the files in processes; the model of one that ends by itself is refused."""
    with worker_pool(jobs, partial(_check_in_worker, up, cache_dir)) as pool:
        running = {pool.submit(file): file for file in files}
        for future in as_completed(running):
            try:
                yield future.result()
            except LostWorkerError as error:
                name, cause = running[future].name, "too little memory, or a crash"
                reason = f"the process that read it exited with {error.found} ({cause})"
                yield ModelCheck(name, False, f"{reason}; simplify the mesh", 0)

"""Every model of a folder tried once: which can be used, what was mended, why others cannot be."""

import multiprocessing
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path

from scenegen.meshes.cache import MeshCache
from scenegen.meshes.errors import BadMeshError
from scenegen.meshes.folders import ModelFile, ModelFolder

_ENDED = "reading it ended the process (too little memory, or a crash); simplify the file"
# What makes a model count as mended; seams and loose vertices are everywhere and harmless.
DEFECTS = ("faces_out_of_range", "faces_not_finite", "degenerate_faces", "double_faces")


@dataclass(frozen=True)
class ModelCheck:
    """What became of one model.

    Attributes:
        name: "class/id".
        ok: whether it can be used.
        reason: why not; empty if it can.
        faces: triangles after cleaning.
        mended: counts, as `CleanMesh.mended`.
        seconds: taken, with reading it or its cached form.
    """

    name: str
    ok: bool
    reason: str
    faces: int
    mended: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def was_mended(self) -> bool:
        """Whether faces had to be dropped."""
        return any(self.mended.get(name, 0) for name in DEFECTS)


def check_models(
    folder: ModelFolder,
    cache_dir: str | Path | None,
    jobs: int = 1,
    progress: Callable[[int], object] | None = None,
) -> list[ModelCheck]:
    """Load every model, cleaning those that are not in the cache yet.

    Args:
        cache_dir: where cleaned models are kept; nowhere if None.
        jobs: processes; with more than one, a model that takes its process down is refused too.
        progress: called with 1 after each model.

    Returns:
        One record per model, in the listing's order.
    """
    files = [file for name in folder.classes for file in folder.models[name]]
    work = _one_by_one if jobs < 2 or len(files) < 2 else _in_processes
    found = {}
    for record in work(files, folder.up, cache_dir, jobs):
        found[record.name] = record
        if progress:
            progress(1)
    return [found[file.name] for file in files]


def _check(file: ModelFile, up: str, cache: MeshCache) -> ModelCheck:
    started = time.perf_counter()
    try:
        _, model = cache.load(file.path, up)
    except BadMeshError as error:
        return ModelCheck(file.name, False, str(error), 0, {}, time.perf_counter() - started)
    seconds = time.perf_counter() - started
    return ModelCheck(file.name, True, "", len(model.faces), model.mended, seconds)


def _one_by_one(
    files: Sequence[ModelFile], up: str, cache_dir: str | Path | None, _jobs: int
) -> Iterator[ModelCheck]:
    cache = MeshCache(cache_dir)
    for file in files:
        yield _check(file, up, cache)


_OWN_CACHE: list[MeshCache] = []  # one a process, so that each warns once at most


def _start(cache_dir: str | Path | None) -> None:
    _OWN_CACHE[:] = [MeshCache(cache_dir)]


def _check_here(file: ModelFile, up: str) -> ModelCheck:
    return _check(file, up, _OWN_CACHE[0])


def _in_processes(
    files: Sequence[ModelFile], up: str, cache_dir: str | Path | None, jobs: int
) -> Iterator[ModelCheck]:
    """Keep processes busy; where one dies, try what was under way again, each on its own."""
    waiting = list(reversed(files))
    suspects: list[ModelFile] = []
    while waiting or suspects:
        workers = 1 if suspects else jobs
        with _pool(workers, cache_dir) as pool:
            running: dict[Future[ModelCheck], ModelFile] = {}
            while suspects or waiting or running:
                while len(running) < (1 if workers == 1 else 2 * jobs) and (suspects or waiting):
                    if workers == 1 and not suspects:
                        break
                    file = suspects.pop() if suspects else waiting.pop()
                    running[pool.submit(_check_here, file, up)] = file
                if not running:
                    break
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                died = [future for future in done if future.exception() is not None]
                for future in done:
                    if future not in died:
                        yield future.result()
                        del running[future]
                if died:
                    left = list(running.values())
                    if workers == 1:
                        yield ModelCheck(left[0].name, False, _ENDED, 0)
                    else:
                        suspects = left
                    break


def _pool(workers: int, cache_dir: str | Path | None) -> ProcessPoolExecutor:
    # Not forked: threads of the caller, such as a renderer's, must not come along.
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, context, _start, (cache_dir,))

"""Every model of a folder tried once: which can be used, what was mended, why others cannot be."""

import multiprocessing
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path

from scenegen.common.errors import SceneGenError
from scenegen.objects.meshes.cache import MeshCache
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.folders import ModelFile, ModelFolder

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

    Raises:
        SceneGenError: with more than one job, where processes cannot be started.
    """
    files = [file for name in folder.classes for file in folder.models[name]]
    cache = MeshCache(cache_dir)
    cache.try_out()
    records: Iterator[ModelCheck] = (_check(file, folder.up, cache) for file in files)
    if jobs > 1 and len(files) > 1:
        records = _in_processes(files, folder.up, cache.folder, jobs)
    found = {}
    for record in records:
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


_OWN_CACHE: list[MeshCache] = []  # one in each process


def _start(cache_dir: Path | None) -> None:
    warnings.simplefilter("ignore")  # that the cache cannot be used, the caller has been told
    _OWN_CACHE[:] = [MeshCache(cache_dir)]


def _check_here(file: ModelFile, up: str) -> ModelCheck:
    return _check(file, up, _OWN_CACHE[0])


def _in_processes(
    files: Sequence[ModelFile], up: str, cache_dir: Path | None, jobs: int
) -> Iterator[ModelCheck]:
    """Keep processes busy; where one dies, try what was under way again, each on its own."""
    waiting = deque(files)
    while waiting:
        lost: list[ModelFile] = []
        yield from _until_one_dies(waiting, up, cache_dir, jobs, lost)
        for file in lost:
            guilty: list[ModelFile] = []
            yield from _until_one_dies(deque([file]), up, cache_dir, 1, guilty)
            if guilty:
                yield ModelCheck(file.name, False, _ENDED, 0)


def _until_one_dies(
    waiting: deque[ModelFile],
    up: str,
    cache_dir: Path | None,
    jobs: int,
    lost: list[ModelFile],
) -> Iterator[ModelCheck]:
    """Work off what waits; if a process dies, stop and name what was under way in `lost`."""
    running: dict[Future[ModelCheck], ModelFile] = {}
    # Not forked: threads of the caller, such as a renderer's, must not come along.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, _start, (cache_dir,)) as pool:
        try:
            pool.submit(time.perf_counter).result()
        except BrokenProcessPool as error:  # before it saw a model
            raise SceneGenError(
                "check_models: its processes cannot start; call it from under "
                '`if __name__ == "__main__":`, or with jobs=1'
            ) from error
        try:
            while waiting or running:
                while waiting and len(running) < 2 * jobs:
                    running[pool.submit(_check_here, waiting[0], up)] = waiting[0]
                    waiting.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    record = future.result()
                    del running[future]
                    yield record
        except BrokenProcessPool:
            lost.extend(running.values())

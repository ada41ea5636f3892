"""Unit shapes of a folder's models, made when first asked for."""

import threading
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.meshes.cache import CachedModel, MeshCache
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.folders import ModelFile, ModelFolder
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]
MOST_FACES_KEPT = 3_000_000  # of all shapes in memory together; about 100 bytes each


class MeshStore:
    """The shapes of a folder. May be used by several threads; pickles as folder and cache.

    Attributes:
        folder: the listing.
        cache_dir: where cleaned models are kept; nowhere if None.
        problems: reasons by name, of the models refused so far.
    """

    def __init__(self, folder: ModelFolder, cache_dir: str | Path | None) -> None:
        self.folder = folder
        self.cache_dir = None if cache_dir is None else Path(cache_dir)
        self.problems: dict[str, str] = {}
        self._files = {file.name: file for files in folder.models.values() for file in files}
        self._cache = MeshCache(self.cache_dir)
        self._digests: dict[str, str] = {}
        self._shapes: OrderedDict[str, UnitShape] = OrderedDict()
        self._faces = 0
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        return MeshStore, (self.folder, self.cache_dir)

    def shape(self, name: str) -> UnitShape:
        """Return a model, "class/id", as a unit shape: flat faces, resting on its base.

        Its hull points are the corners of its convex hull.

        Raises:
            BadMeshError: no such model, or it cannot be used.
        """
        with self._lock:
            shape = self._shapes.get(name)
            if shape is not None:
                self._shapes.move_to_end(name)
                return shape
        _, model = self._load(name)
        shape = _unit_shape(name, model)
        with self._lock:
            if name not in self._shapes:
                self._faces += len(shape.triangles)
            self._shapes[name] = shape
            while self._faces > MOST_FACES_KEPT and len(self._shapes) > 1:
                _, oldest = self._shapes.popitem(last=False)
                self._faces -= len(oldest.triangles)
        return shape

    def digest(self, name: str) -> str:
        """Return the first 16 hex digits of the content hash of the file behind a model's shape.

        Raises:
            BadMeshError: as `shape`.
        """
        if name not in self._digests:
            self._load(name)
        return self._digests[name][:16]

    def _load(self, name: str) -> tuple[str, CachedModel]:
        file = self._file(name)
        try:
            if name in self.problems:
                raise BadMeshError(self.problems[name])
            digest, model = self._cache.load(file.path, self.folder.up)
        except BadMeshError as error:
            self.problems[name] = str(error)
            raise BadMeshError(f"{name}: {error}") from error
        self._digests[name] = digest
        return digest, model

    def _file(self, name: str) -> ModelFile:
        if name not in self._files:
            raise BadMeshError(
                f"{name}: no such model in this folder and split; names are class/id, "
                f"such as {next(iter(self._files), 'mug/1')}"
            )
        return self._files[name]


def _unit_shape(name: str, model: CachedModel) -> UnitShape:
    triangles = model.vertices.astype(np.float64)[model.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    flat = np.broadcast_to(normals[:, None], triangles.shape)  # one copy for the three corners
    hull = model.hull_points
    down = np.array([[0.0, -1.0, 0.0]])
    return UnitShape(name, triangles, flat, hull, np.zeros(len(hull)), 0.0, down)

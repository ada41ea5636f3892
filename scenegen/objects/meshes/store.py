"""The unit shapes of a folder's models, made when first used and kept in memory for a while."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.common.recent import Recent, bytes_alive
from scenegen.objects.cache import DiskCache
from scenegen.objects.furniture.furnishing import Paint
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.listing import ModelFolder
from scenegen.objects.meshes.models import Model, load_model
from scenegen.objects.meshes.read import read_bytes
from scenegen.objects.solids import Array, Mesh, UnitShape

MOST_KEPT = 300_000_000  # bytes of all shapes in memory
COLORS = 36  # bytes of a face's, which are read where they are asked for


class MeshStore:
    """The unit shapes of a folder's models. Several threads may share it.

    Attributes:
        folder: the listing of the models.
        problems: reasons, by name, why models were refused so far.
    """

    def __init__(self, folder: ModelFolder, cache_dir: str | Path | None) -> None:
        self.folder = folder
        self.problems: dict[str, str] = {}
        self._files = {file.name: file for files in folder.models.values() for file in files}
        self._disk = DiskCache(cache_dir)
        self._digests: dict[str, str] = {}
        self._unread: set[str] = set()  # kinds that were told
        self._shapes: Recent[UnitShape] = Recent(MOST_KEPT)

    def __reduce__(self) -> Any:
        """Pickle the folders and the problems; another process loads its models itself."""
        return MeshStore, (self.folder, self._disk.folder), {"problems": self.problems}

    def shape(self, name: str) -> UnitShape:
        """Return the model named "class/id" as a unit shape with flat faces, resting on its base.

        Raises BadMeshError where there is no such model or it cannot be used.
        """
        shape = self._shapes.get(name)
        if shape is None:
            model = self._load(name)
            shape = replace(_unit_shape(name, model), make_colors=lambda: self._colors(name, model))
            self._shapes.put(name, shape, bytes_alive(shape) + COLORS * len(shape.mesh.faces))
        return shape

    def digest(self, name: str) -> str:
        """Return the first 16 hex digits of the content hash of a model's file.

        Raises BadMeshError as `shape` does.
        """
        if name not in self._digests:
            self._load(name)
        return self._digests[name][:16]

    def _colors(self, name: str, model: Model) -> Array:
        """Return the own colours of a model. Raises BadMeshError."""
        from scenegen.objects.meshes.appearance.colors import (
            corner_colors,  # imports trimesh, which is slow
        )

        path, unread = self._files[name].path, dict[str, str]()
        try:
            mesh = model.vertices, model.faces
            return corner_colors(read_bytes(path), path.suffix, self.folder.up, *mesh, unread)
        except BadMeshError as error:
            raise error.inside(name) from error
        finally:
            self._warn(name, unread)

    def _warn(self, name: str, unread: dict[str, str]) -> None:
        """Tell what is not read of a model; of each kind the first model tells enough."""
        for kind in unread.keys() - self._unread:
            self._unread.add(kind)
            warnings.warn(f"{name} {unread[kind]}", stacklevel=3)

    def paint(self, name: str) -> Paint | None:
        """Return what a model's file and those beside it say about its surface, if they do.

        Raises BadMeshError as `shape`, and where these cannot be read.
        """
        from scenegen.objects.meshes.appearance.textures import (
            paint_of,  # imports trimesh, which is slow
        )

        model = self._load(name)
        path, up = self._files[name].path, self.folder.up
        unread: dict[str, str] = {}
        with self._told(name):
            try:
                paint = paint_of(path, up, model.vertices, model.faces, unread)
            except (BadMeshError, MemoryError):
                raise
            except Exception as error:  # one bad picture must not stop a run
                problem = f"{type(error).__name__}: {error}"
                raise BadMeshError("colours and textures", problem, "readable ones") from error
        self._warn(name, unread)
        return paint

    @contextmanager
    def _told(self, name: str) -> Iterator[None]:
        """Keep why a model is refused, and tell its name."""
        try:
            yield
        except BadMeshError as error:
            self.problems[name] = str(error)
            raise error.inside(name) from error

    def _load(self, name: str) -> Model:
        if name not in self._files:
            example = next(iter(self._files), "mug/1")
            expected = f"class/id of this folder and split, such as {example}"
            raise BadMeshError("model", repr(name), expected)
        with self._told(name):
            if name in self.problems:
                raise BadMeshError(self.problems[name])
            model = load_model(self._files[name].path, self.folder.up, self._disk)
        self._digests[name] = model.digest
        return model


def _unit_shape(name: str, model: Model) -> UnitShape:
    mesh, hull = Mesh(model.vertices, model.faces, None), model.hull_points
    down = np.array([[0.0, -1.0, 0.0]])
    discs = np.zeros(len(hull))
    return UnitShape(name, lambda: mesh, hull, discs, 0.0, down, coarse=model.coarse)

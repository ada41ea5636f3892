"""A cache of cleaned models on disk, one file each, named by the hash of the original's content.

Several processes may share a folder, as an entry gets its name when it is complete. A damaged
entry is made again. If the folder cannot be written to, a warning is given and nothing is cached.
"""

import errno
import hashlib
import json
import os
import threading
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenegen.files.new_file import written_beside
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.hull import hull_points
from scenegen.objects.meshes.read import parse_mesh, read_bytes
from scenegen.objects.solids import Array

_ARRAYS = {"vertices": np.float32, "faces": np.int32, "hull_points": np.float64}
CLEANING_VERSION = 2  # raise it when a file would give other triangles or hull points than before


@dataclass(frozen=True, eq=False)
class CachedModel:
    """A cleaned model, or the reason why it cannot be used.

    Attributes:
        vertices, faces, mended: as in `CleanMesh`.
        hull_points: as from `hull.hull_points`, (H, 3) float64.
        refusal: the reason why it cannot be used; the arrays are then empty.
    """

    vertices: Array
    faces: Array
    hull_points: Array
    mended: Mapping[str, int]
    refusal: str | None = None


def default_cache_dir() -> Path:
    """Return `pix2shape-bench/meshes` in XDG_CACHE_HOME or, if that is not set, in ~/.cache."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():  # the XDG specification says to ignore relative paths
        base = Path("~/.cache").expanduser()
    return base / "pix2shape-bench" / "meshes"


def content_hash(data: bytes, suffix: str, up: str) -> str:
    """Return the SHA-256, as hex, of cleaning version, file suffix, up axis and file content."""
    digest = hashlib.sha256(f"{CLEANING_VERSION} {suffix.lower()} {up}\n".encode())
    digest.update(data)
    return digest.hexdigest()


class MeshCache:
    """Cleaned models in a folder. Without a folder, each is cleaned whenever it is loaded."""

    def __init__(self, folder: str | Path | None) -> None:
        self.folder = None if folder is None else Path(folder)
        self._lock = threading.Lock()

    def load(self, path: Path, up: str) -> tuple[str, CachedModel]:
        """Return a file's content hash and its cleaned model, from the cache if it is there.

        Raises:
            BadMeshError: the file cannot be read, or the model cannot be used.
        """
        data = read_bytes(path)
        digest = content_hash(data, path.suffix, up)
        entry = self.folder / f"{digest}.npz" if self.folder else None
        model = _read_entry(entry) if entry else None
        if model is None:
            model = make_model(data, path.suffix, up)
            if entry:
                self._write(entry, model)
        if model.refusal is not None:
            raise BadMeshError(model.refusal)
        return digest, model

    def try_out(self) -> None:
        """Create the folder, so that a warning about it comes before the work."""
        if self.folder is None:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if not os.access(self.folder, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except OSError as error:
            self._give_up(error)

    def _write(self, entry: Path, model: CachedModel) -> None:
        about = {"mended": dict(model.mended), "refusal": model.refusal}
        try:
            entry.parent.mkdir(parents=True, exist_ok=True)
            with written_beside(entry, overwrite=True) as temporary, temporary.open("xb") as file:
                arrays = {name: getattr(model, name) for name in _ARRAYS}
                text = np.frombuffer(json.dumps(about).encode(), np.uint8)
                np.savez(file, **arrays, about=text)
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        with self._lock:
            folder, self.folder = self.folder, None
        if folder is not None:
            reason = os.strerror(error.errno or errno.EIO)
            warnings.warn(
                f"{folder}: cannot be written to ({reason}), so models are cleaned again in"
                " every process; choose another --cache-dir",
                stacklevel=2,
            )


def make_model(data: bytes, suffix: str, up: str) -> CachedModel:
    """Read and clean a file's content. If it cannot be used, the result says why.

    Raises:
        BadMeshError: for reasons that may not lie in the file and so must not be cached, such as
            too little memory.
    """
    try:
        mesh = clean_mesh(*parse_mesh(data, suffix), up)
        return CachedModel(mesh.vertices, mesh.faces, hull_points(mesh.vertices), mesh.mended)
    except BadMeshError as error:
        none = np.empty((0, 3), np.float32)
        return CachedModel(none, none.astype(np.int32), none.astype(np.float64), {}, str(error))
    except MemoryError as error:
        raise BadMeshError("model", "more data than fits into memory", "", "simplify it") from error
    except Exception as error:  # one bad model must not stop a run of a million
        found = f"{type(error).__name__}: {error}"
        raise BadMeshError("cleaning", found, hint="please report the file") from error


def _read_entry(entry: Path) -> CachedModel | None:
    """Return the model of a cache entry; None if it is missing or damaged."""
    try:
        with entry.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            about = json.loads(arrays["about"].tobytes())
            model = CachedModel(**{name: arrays[name] for name in _ARRAYS}, **about)
    except Exception:  # whatever the damage is, the entry is made again
        return None
    return model if _is_whole(model) else None


def _is_whole(model: CachedModel) -> bool:
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    if any(a.shape[1:] != (3,) or a.dtype != _ARRAYS[name] for name, a in arrays.items()):
        return False
    if model.refusal is not None:
        return isinstance(model.refusal, str)
    some = all(len(a) for a in arrays.values())
    return bool(some and model.faces.min() >= 0 and model.faces.max() < len(model.vertices))

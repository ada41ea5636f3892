"""A model of a folder: its file is read, mended and kept on disk, or refused with a reason."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenegen.objects.cache import DiskCache
from scenegen.objects.coarse_hulls import MOST_CORNERS, coarse_hull
from scenegen.objects.meshes.clean import clean_mesh
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.hull import hull_points
from scenegen.objects.meshes.read import parse_mesh, read_bytes
from scenegen.objects.solids import Array

CLEANING_VERSION = 2  # raise it when a file would give other triangles or hull points than before
_ARRAYS = ("vertices", "faces", "hull_points", "mended", "refusal")


@dataclass(frozen=True, eq=False)
class Model:
    """A model that can be used.

    Attributes:
        digest: content hash of its file, as from `content_hash`.
        vertices, faces, mended: as in `CleanMesh`.
        hull_points: as from `hull.hull_points`, (H, 3) float64.
        coarse: as from `coarse_hulls.coarse_hull`, for a hull of more than MOST_CORNERS points.
    """

    digest: str
    vertices: Array
    faces: Array
    hull_points: Array
    mended: Mapping[str, int]
    coarse: tuple[Array, float] | None


def load_model(path: Path, up: str, cache: DiskCache) -> Model:
    """Return a file's cleaned model, from the cache if it is there.

    Raises BadMeshError where the file cannot be read or the model cannot be used. Reasons that lie
    in the file are kept in the cache, too.
    """
    data = read_bytes(path)
    digest = content_hash(data, path.suffix, up)
    arrays = cache.read(digest, _ARRAYS)
    if arrays is None:
        arrays = _cleaned(data, path.suffix, up)
        cache.write(digest, arrays)
    if reason := str(arrays["refusal"]):
        raise BadMeshError(reason)
    vertices, faces, corners = (arrays[name] for name in _ARRAYS[:3])
    coarse = _coarse(digest, corners, cache)
    return Model(digest, vertices, faces, corners, json.loads(str(arrays["mended"])), coarse)


def _coarse(digest: str, corners: Array, cache: DiskCache) -> tuple[Array, float] | None:
    """Return a body's coarser one, if it has one, from the cache if it is there."""
    if len(corners) <= MOST_CORNERS:
        return None
    key = f"{digest}-coarse"
    arrays = cache.read(key, ("points", "growth"))
    if arrays is not None:
        return arrays["points"], float(arrays["growth"])
    coarse = coarse_hull(np.column_stack([corners, np.zeros(len(corners))]))
    cache.write(key, {"points": coarse[0], "growth": np.array(coarse[1])})
    return coarse


def content_hash(data: bytes, suffix: str, up: str) -> str:
    """Return the SHA-256, as hex, of cleaning version, file suffix, up axis and file content."""
    digest = hashlib.sha256(f"{CLEANING_VERSION} {suffix.lower()} {up}\n".encode())
    digest.update(data)
    return digest.hexdigest()


def _cleaned(data: bytes, suffix: str, up: str) -> dict[str, Array]:
    """Read and clean a file's content; "refusal" says why it cannot be used, or is empty.

    Raises BadMeshError for reasons that may not lie in the file, such as too little memory.
    """
    try:
        mesh = clean_mesh(*parse_mesh(data, suffix), up)
        arrays = mesh.vertices, mesh.faces, hull_points(mesh.vertices)
        mended, refusal = dict(mesh.mended), ""
    except BadMeshError as error:
        arrays = np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3))
        mended, refusal = {}, str(error)
    except MemoryError as error:
        raise BadMeshError("model", "more data than fits into memory", "", "simplify it") from error
    except Exception as error:  # one bad model must not stop a run of a million
        problem = f"{type(error).__name__}: {error}"
        raise BadMeshError("cleaning", problem, hint="please report the file") from error
    texts = np.array(json.dumps(mended)), np.array(refusal)
    return dict(zip(_ARRAYS, (*arrays, *texts), strict=True))

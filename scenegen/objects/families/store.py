"""Members of families as they are placed and cast: made once, then kept on disk and in memory."""

import functools
import hashlib
from pathlib import Path

import numpy as np

import scenegen
from scenegen.common.recent import Recent
from scenegen.objects.cache import DiskCache
from scenegen.objects.cast_meshes import cast_mesh
from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.objects.families.members import check_member, make_member
from scenegen.objects.families.parts.assembly import UPRIGHT
from scenegen.objects.solids import Array, Mesh, UnitShape, no_mesh, outline_of

MOST_KEPT = 100_000_000  # bytes of the meshes in memory
_SOURCES = (
    "common/rotations.py",
    *(f"objects/{name}.py" for name in ("solids", "cast_meshes", "coarse_hulls")),
)
_OUTLINE, _MESH = ("hull_points", "hull_discs"), ("vertices", "faces", "normals")


class MemberStore:
    """Members of families. Several threads may share it."""

    def __init__(self, folder: str | Path | None = None) -> None:
        self._disk = DiskCache(folder)
        self._meshes: Recent[Mesh] = Recent(MOST_KEPT)

    @property
    def folder(self) -> Path | None:
        """The folder where members are kept; None where they are kept in memory alone."""
        return self._disk.folder

    def use(self, folder: str | Path | None) -> None:
        """Keep members in this folder from now on, or in none."""
        self._disk = DiskCache(folder)

    def outline(self, family: str, number: int) -> tuple[UnitShape, int]:
        """Return a member's outline, as from `outline_of`, and its number of triangles.

        Raises as `make_member`.
        """
        arrays = self._arrays(family, number)
        points, discs = (arrays[name] for name in _OUTLINE)
        name = f"{family}/{number:04d}"
        shape = UnitShape(name, no_mesh, points, discs, 0.0, UPRIGHT)
        return outline_of(shape), len(arrays["faces"])

    def mesh(self, family: str, number: int) -> Mesh:
        """Return a member's mesh. Raises as `make_member`."""
        return self._meshes.get((family, number)) or _mesh(self._arrays(family, number))

    def _arrays(self, family: str, number: int) -> dict[str, Array]:
        """Return all of a member, and keep its mesh in memory: what is placed is soon cast."""
        check_member(family, number)
        key = f"{family}-{number:04d}-{code_version()}"
        arrays = self._disk.read(key, _OUTLINE + _MESH) or self._made(family, number, key)
        self._meshes.put((family, number), _mesh(arrays))
        return arrays

    def _made(self, family: str, number: int, key: str) -> dict[str, Array]:
        shape = make_member(family, number)
        mesh = shape.mesh
        # Cosines and sums differ in their last bits between processors, and what is 0 may be 1e-17.
        placed = None if mesh.normals is None else rounded(mesh.normals, POINT_STEP)
        mesh = cast_mesh(Mesh(rounded(mesh.vertices, POINT_STEP), mesh.faces, placed))
        outline = {name: getattr(shape, name) for name in _OUTLINE}
        arrays = {**outline, **{name: getattr(mesh, name) for name in _MESH}}
        self._disk.write(key, arrays)
        return arrays


def _mesh(arrays: dict[str, Array]) -> Mesh:
    return Mesh(*(arrays[name] for name in _MESH))


@functools.cache
def code_version() -> str:
    """Return 16 hex digits of the SHA-256 of the code that makes members, and of numpy's version.

    Functions such as the cosine may differ in their last bits from one numpy to the next.
    """
    root = Path(scenegen.__file__).parent
    made_by = sorted((root / "objects" / "families").rglob("*.py"))
    digest = hashlib.sha256(np.__version__.encode())
    for path in [*made_by, *(root / name for name in _SOURCES)]:
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


MEMBER_STORE = MemberStore()  # of the process, as members depend on their names alone

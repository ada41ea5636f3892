"""Members of families as they are placed and cast: made once, then kept on disk and in memory."""

import functools
import hashlib
from pathlib import Path

import numpy as np

import scenegen
from scenegen.common.recent import Recent
from scenegen.objects.cache import DiskCache
from scenegen.objects.cast_meshes import CastMesh, cast_mesh
from scenegen.objects.families.members import check_member, make_member
from scenegen.objects.families.parts.assembly import UPRIGHT
from scenegen.objects.solids import Array, UnitShape, no_mesh

MOST_FACES_KEPT = 1_000_000  # of the meshes in memory; a face takes 84 bytes
_SOURCES = ("common/rotations.py", "objects/solids.py", "objects/cast_meshes.py")
_OUTLINE, _MESH = ("hull_points", "hull_discs", "face_count"), ("triangles", "normals")


class MemberStore:
    """Members of families. Several threads may share it."""

    def __init__(self, folder: str | Path | None = None) -> None:
        self._disk = DiskCache(folder)
        self._meshes: Recent[CastMesh] = Recent(MOST_FACES_KEPT)

    @property
    def folder(self) -> Path | None:
        """The folder where members are kept; None where they are kept in memory alone."""
        return self._disk.folder

    def use(self, folder: str | Path | None) -> None:
        """Keep members in this folder from now on, or in none."""
        self._disk = DiskCache(folder)

    def outline(self, family: str, number: int) -> tuple[UnitShape, int]:
        """Return a member without its triangles, and their number. Raises as `make_member`."""
        arrays = self._arrays(family, number, _OUTLINE)
        points, discs, face_count = (arrays[name] for name in _OUTLINE)
        name = f"{family}/{number:04d}"
        return UnitShape(name, no_mesh, points, discs, 0.0, UPRIGHT), int(face_count)

    def mesh(self, family: str, number: int) -> CastMesh:
        """Return a member's mesh. Raises as `make_member`."""
        mesh = self._meshes.get((family, number))
        if mesh is None:
            arrays = self._arrays(family, number, _MESH)
            mesh = CastMesh(arrays["triangles"], arrays["normals"])
            self._meshes.put((family, number), mesh, len(mesh.normals))
        return mesh

    def _arrays(self, family: str, number: int, names: tuple[str, ...]) -> dict[str, Array]:
        check_member(family, number)
        key = f"{family}-{number:04d}-{code_version()}"
        return self._disk.read(key, names) or self._made(family, number, key)

    def _made(self, family: str, number: int, key: str) -> dict[str, Array]:
        shape = make_member(family, number)
        mesh = cast_mesh(shape)
        self._meshes.put((family, number), mesh, len(mesh.normals))
        arrays = {
            "hull_points": shape.hull_points,
            "hull_discs": shape.hull_discs,
            "face_count": np.array(len(mesh.normals)),
            "triangles": mesh.triangles,
            "normals": mesh.normals,
        }
        self._disk.write(key, arrays)
        return arrays


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

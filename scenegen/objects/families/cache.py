"""A cache of members on disk, as the ray caster takes them: one file each, made when first used.

The files lie in a folder named after the code that makes them, so that a changed family never meets
members of an older one. Several processes may share it, as a file gets its name when it is
complete. A damaged file is made again. If the folder cannot be written to, a warning is given, and
members that are not in it are made in every process.
"""

import errno
import functools
import hashlib
import os
import struct
import threading
import warnings
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path

import numpy as np
from isal import isal_zlib

import scenegen
from scenegen.description.scenes import FAMILY_NAMES
from scenegen.files.new_file import written_beside
from scenegen.objects.cast_meshes import CastMesh, cast_mesh
from scenegen.objects.families.members import make_member
from scenegen.objects.families.parts.assembly import UPRIGHT
from scenegen.objects.solids import Array, UnitShape, without_triangles

MOST_FACES_KEPT = 1_000_000  # of the meshes in memory; a face takes 84 bytes
_SOURCES = ("common/rotations.py", "objects/solids.py", "objects/cast_meshes.py")
_SIZES = struct.Struct("<2I")  # faces, rows of the hull
_CHECKS = struct.Struct("<2I")  # CRC-32 of sizes and hull, and of the mesh
_HEAD = struct.Struct("<4I")  # sizes and checks
_HULL_ROW, _FACE = 4 * 8, (9 + 12) * 4  # bytes
_MOST_BYTES = 2**24  # of a file; a member takes some 0.2 MB
_FIRST_READ = 2**14  # bytes, which hold the head and nearly every hull


Member = tuple[str, int]  # family and number


class MemberCache:
    """Members in a folder, and those used last in memory. Several threads may share it.

    Attributes:
        home: the folder that was given; None to keep no files.
        folder: where in it the files are.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        self.use(folder)
        self._meshes: OrderedDict[Member, CastMesh] = OrderedDict()
        self._faces = 0
        self._lock = threading.Lock()

    def use(self, folder: str | Path | None) -> None:
        """Keep files in this folder from now on, or none."""
        self.home = None if folder is None else Path(folder)
        self.folder = None if self.home is None else self.home / f"members-{code_version()}"
        self._writes = folder is not None

    def outline(self, family: str, number: int) -> tuple[UnitShape, int]:
        """Return a member without its triangles, and their number. Raises as `make_member`."""
        member = family, number
        return self._read_outline(member) or self._make(member)[:2]

    def mesh(self, family: str, number: int) -> CastMesh:
        """Return a member's mesh. Raises as `make_member`."""
        member = family, number
        with self._lock:
            kept = self._meshes.get(member)
        return kept or self._read_mesh(member) or self._make(member)[2]

    def _make(self, member: Member) -> tuple[UnitShape, int, CastMesh]:
        shape = make_member(*member)
        outline, mesh = without_triangles(shape), cast_mesh(shape)
        self._keep(member, mesh)
        if self._writes:
            self._write(member, outline, mesh)
        return outline, len(shape.triangles), mesh

    def _keep(self, member: Member, mesh: CastMesh) -> None:
        with self._lock:
            if member not in self._meshes:
                self._meshes[member] = mesh
                self._faces += len(mesh.normals)
            while self._faces > MOST_FACES_KEPT:
                _, oldest = self._meshes.popitem(last=False)
                self._faces -= len(oldest.normals)

    def _read_outline(self, member: Member) -> tuple[UnitShape, int] | None:
        data = self._read(member, _FIRST_READ)
        faces, rows, check, _ = _HEAD.unpack_from(data) if data else (0, 0, 0, 0)
        hull = data[_HEAD.size : _HEAD.size + rows * _HULL_ROW]
        if not rows or isal_zlib.crc32(hull, isal_zlib.crc32(data[: _SIZES.size])) != check:
            return None
        values = np.frombuffer(hull, "<f8").astype(float)
        points, discs = values[: 3 * rows].reshape(rows, 3), values[3 * rows :]
        name, nothing = f"{member[0]}/{member[1]:04d}", np.zeros((0, 3, 3))
        mesh = nothing, nothing
        return UnitShape(name, lambda: mesh, points, discs, 0.0, UPRIGHT), faces

    def _read_mesh(self, member: Member) -> CastMesh | None:
        data = self._read(member, _MOST_BYTES)
        faces, rows, _, check = _HEAD.unpack_from(data) if data else (0, 0, 0, 0)
        start = _HEAD.size + rows * _HULL_ROW
        if len(data) != start + faces * _FACE or isal_zlib.crc32(memoryview(data)[start:]) != check:
            return None
        triangles = np.frombuffer(data, "<f4", 9 * faces, start).reshape(faces, 3, 3)
        normals = np.frombuffer(data, "<f4", 12 * faces, start + 36 * faces).reshape(faces, 12)
        return CastMesh(triangles, normals)

    def _read(self, member: Member, most: int) -> bytes:
        """Return a file's first bytes; none where there is no file, or not even a head."""
        data = b""
        if self.folder and member[0] in FAMILY_NAMES:
            with suppress(OSError), self._path(member).open("rb", buffering=0) as file:
                data = file.read(most) or b""
        return data if len(data) >= _HEAD.size else b""

    def _path(self, member: Member) -> Path:
        assert self.folder is not None
        return self.folder / f"{member[0]}-{member[1]:04d}.bin"

    def _write(self, member: Member, outline: UnitShape, mesh: CastMesh) -> None:
        hull = _bytes("<f8", outline.hull_points, outline.hull_discs)
        body = _bytes("<f4", mesh.triangles, mesh.normals)
        sizes = _SIZES.pack(len(mesh.normals), len(outline.hull_discs))
        checks = isal_zlib.crc32(hull, isal_zlib.crc32(sizes)), isal_zlib.crc32(body)
        try:
            path = self._path(member)
            path.parent.mkdir(parents=True, exist_ok=True)
            with written_beside(path, overwrite=True) as temporary:
                temporary.write_bytes(sizes + _CHECKS.pack(*checks) + hull + body)
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        with self._lock:
            wrote, self._writes = self._writes, False
        if wrote:
            reason = os.strerror(error.errno or errno.EIO)
            warnings.warn(
                f"{self.folder}: cannot be written to ({reason}), so members that are not there are"
                " made in every process; choose another --cache-dir",
                stacklevel=2,
            )


def _bytes(kind: str, *arrays: Array) -> bytes:
    return b"".join(np.ascontiguousarray(array, kind).tobytes() for array in arrays)


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


MEMBERS_KEPT = MemberCache()  # of the process: members depend on their names alone

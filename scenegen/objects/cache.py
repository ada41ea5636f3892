"""A cache on disk of arrays that take long to make, for later runs and other processes."""

import errno
import json
import math
import os
import secrets
import struct
import threading
import warnings
from collections.abc import Sequence
from contextlib import suppress
from io import RawIOBase
from pathlib import Path

import numpy as np
from isal import isal_zlib

from scenegen.objects.solids import Array

MOST_BYTES = 2**35  # of the entries in a folder
ENDING = ".arrays"
_LENGTH_AND_CHECK = struct.Struct("<2I")  # of the header


def default_cache_dir(name: str = "meshes") -> Path | None:
    """Return `pix2shape-bench/<name>` in XDG_CACHE_HOME or, if that is not set, in ~/.cache.

    None where the user has no home folder, as in containers that run as a foreign user.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():  # the XDG specification says to ignore relative paths
        try:
            base = Path("~/.cache").expanduser()
        except RuntimeError:
            return None
    return base / "pix2shape-bench" / name


class DiskCache:
    """Arrays in a folder, one file for each key. Threads and processes may share the folder.

    A file is a JSON header, {name: [dtype, shape, offset, CRC-32]}, and the arrays' bytes. Reading
    some arrays of it takes a tenth of the time of an npz file.

    A key is a hash of everything that its arrays follow from, so an entry never grows old. An entry
    gets its name when it is complete; a damaged one counts as missing. If the folder cannot be
    written to, one warning is given, and entries that are there are still read.

    Attributes:
        folder: where the entries lie; None to keep none.
        most: bytes of the entries in the folder.
    """

    def __init__(
        self, folder: str | Path | None = None, most: int = MOST_BYTES, warns: bool = True
    ) -> None:
        self.folder = None if folder is None else Path(folder)
        self.most, self._warns = most, warns
        self._writes = self.folder is not None
        self._unseen = most  # bytes written since the size of the folder was last seen
        self._lock = threading.Lock()

    def read(self, key: str, names: Sequence[str]) -> dict[str, Array] | None:
        """Return the arrays with these names; None where the entry is missing or damaged."""
        if self.folder is None:
            return None
        try:
            with (self.folder / f"{key}{ENDING}").open("rb", buffering=0) as file:
                return _read_arrays(file, names)
        except Exception:  # of whatever kind the damage is, the entry is made again
            return None

    def write(self, key: str, arrays: dict[str, Array]) -> None:
        """Keep arrays under a key; a folder above `most` loses the entries written first."""
        if self.folder is None or not self._writes:
            return
        # What a killed process leaves of the first name is an entry that nobody asks for.
        begun = self.folder / f"{key}.{secrets.token_hex(8)}{ENDING}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            data = _as_bytes(arrays)
            try:
                begun.write_bytes(data)
                os.replace(begun, self.folder / f"{key}{ENDING}")
            except BaseException:
                begun.unlink(missing_ok=True)
                raise
            self._trim(len(data))
        except OSError as error:
            self._give_up(error)

    def check_folder(self) -> None:
        """Make the folder, so that a warning about it comes before the work."""
        if self.folder is None:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if not os.access(self.folder, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except OSError as error:
            self._give_up(error)

    def _trim(self, written: int) -> None:
        """Remove what was written first from a folder that is too large.

        The folder is listed at the first entry that is written, and then once in a while.
        """
        assert self.folder is not None
        with self._lock:
            self._unseen += written
            if self._unseen < self.most // 16:
                return
            self._unseen = 0
        entries = []
        for entry in os.scandir(self.folder):
            with suppress(OSError):  # another process has removed it
                if entry.name.endswith(ENDING):
                    about = entry.stat()
                    entries.append((about.st_mtime_ns, about.st_size, entry.path))
        excess = sum(size for _, size, _ in entries) - self.most
        for _, size, path in sorted(entries):
            if excess <= 0:
                break
            Path(path).unlink(missing_ok=True)
            excess -= size

    def _give_up(self, error: OSError) -> None:
        with self._lock:
            wrote, self._writes = self._writes, False
        if wrote and self._warns:
            reason = os.strerror(error.errno or errno.EIO)
            warnings.warn(
                f"{self.folder}: cannot be written to ({reason}). Shapes that are not there are"
                " made again in every process. Choose another --cache-dir.",
                stacklevel=3,
            )


def _as_bytes(arrays: dict[str, Array]) -> bytes:
    header, parts, offset = {}, list[bytes](), 0
    for name, array in arrays.items():
        parts.append(np.ascontiguousarray(array).tobytes())
        header[name] = [array.dtype.str, array.shape, offset, isal_zlib.crc32(parts[-1])]
        offset += len(parts[-1])
    text = json.dumps(header).encode()
    return b"".join([_LENGTH_AND_CHECK.pack(len(text), isal_zlib.crc32(text)), text, *parts])


def _read_arrays(file: RawIOBase, names: Sequence[str]) -> dict[str, Array]:
    """Read some arrays of a file. Raises an exception of any kind where it is damaged."""
    data = file.read() or b""
    length, check = _LENGTH_AND_CHECK.unpack_from(data)
    start = _LENGTH_AND_CHECK.size + length
    text = data[_LENGTH_AND_CHECK.size : start]
    if isal_zlib.crc32(text) != check:
        raise ValueError("damaged header")
    header = json.loads(text)
    arrays = {}
    for name in names:
        dtype, shape, offset, check = header[name]
        kind, count = np.dtype(dtype), math.prod(shape)
        first, last = start + offset, start + offset + count * kind.itemsize
        part = memoryview(data)[first:last]
        if isal_zlib.crc32(part) != check:
            raise ValueError("damaged array")
        arrays[name] = np.frombuffer(part, kind, count).reshape(shape)
    return arrays

"""The manifest of a set: the request that it answers, and which of its files are complete.

It is JSON beside the files, such as `rooms.manifest.json`, written anew as they are completed. So a
run that was killed can go on, and anyone can check the files by their SHA-256.
"""

import hashlib
import json
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenegen.common.cgroup import processors
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check, from_json
from scenegen.files.new_file import written_beside
from scenegen.files.places import as_place
from scenegen.files.sets.shards import name_of_set
from scenegen.files.sets.workers import in_threads

ENDING = ".manifest.json"
FORMAT = "pix2shape-bench manifest 1"
MOST_BYTES = 20_000_000  # of 20,000 files with long names; read whole


@dataclass(frozen=True)
class FileRecord:
    """A complete file with rows: a shard, or a whole file of a set that has several.

    Attributes:
        file: its name, without a folder.
        rows: the number of its rows.
        bytes: its size.
        sha256: of the whole file.
        content_digest: its attribute of that name.
    """

    file: str
    rows: int
    bytes: int
    sha256: str
    content_digest: str

    def __post_init__(self) -> None:
        _check_name(self.file)


@dataclass(frozen=True)
class Manifest:
    """What a set of files is, and how far it is made.

    Attributes:
        format: FORMAT.
        kind: the attribute `format` of its HDF5 files.
        files: names of the files that readers open; those with shards show them as one.
        spec: the request, as JSON.
        count, shard_size: numbers of items, in all and of a shard.
        settings: what else the bytes depend on: compression, variant, versions.
        complete: whether all files are there.
        shards: the files with rows that are complete, by their names.
    """

    format: str
    kind: str
    files: tuple[str, ...]
    spec: str
    count: int
    shard_size: int
    settings: tuple[tuple[str, str], ...]
    complete: bool = False
    shards: tuple[FileRecord, ...] = ()

    def __post_init__(self) -> None:
        check(len(self.files) > 0, "files", "none", "at least one")
        for name in self.files:
            _check_name(name)
        try:
            request = json.loads(self.spec)
        except (ValueError, RecursionError):
            request = None
        check(isinstance(request, dict), "spec", f"{self.spec!r:.60}", "a JSON object")
        check(self.count > 0, "count", self.count, "at least 1")
        check(self.shard_size > 0, "shard_size", self.shard_size, "at least 1")

    def differences(self, other: "Manifest") -> list[str]:
        """Return what makes the bytes of another set other ones: `name here, not there`."""
        ours, theirs = self._request(), other._request()
        return [
            f"{name} {ours.get(name)}, not {theirs.get(name)}"
            for name in sorted(ours.keys() | theirs.keys())
            if ours.get(name) != theirs.get(name)
        ]

    def _request(self) -> dict[str, Any]:
        names = {"files": ", ".join(self.files), "kind": self.kind}
        numbers = {"n": self.count, "shard-size": self.shard_size}
        return {**json.loads(self.spec), **dict(self.settings), **names, **numbers}

    def shards_of(self, file: str) -> list[FileRecord]:
        """Return the complete shards of one of `files`, in order; itself if it has none."""
        return [shard for shard in self.shards if file in (shard.file, name_of_set(shard.file))]


def _check_name(name: str) -> None:
    plain = name not in ("", ".", "..") and not re.search(r"[/\\\0]", name)
    check(plain, "file", repr(name), "the name of a file beside the manifest")


def manifest_path(path: str | Path) -> Path:
    """Return where the manifest of a set is whose one file is at `path`."""
    return as_place(path).with_suffix(ENDING)


def write_manifest(place: Path, manifest: Manifest) -> None:
    """Write a manifest, in one step."""
    text = json.dumps(manifest, default=vars, indent=1)
    with written_beside(place, overwrite=True) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_manifest(place: Path) -> Manifest:
    """Read a manifest. Raises FileFormatError where it is not one, and OSError."""
    if not place.is_file():
        problem = "is no regular file" if place.exists() else "no such file"
        raise FileFormatError(f"{place}: {problem}", expected="a manifest")
    with place.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    try:
        manifest = from_json(Manifest, data, "manifest", MOST_BYTES)
    except SpecError as error:
        raise FileFormatError(f"{place}: {error.where}", error.found, error.expected) from error
    if manifest.format != FORMAT:
        raise FileFormatError(place, f"format {manifest.format!r:.60}", FORMAT)
    return manifest


def manifests_in(folder: Path, kind: str) -> list[tuple[Path, Manifest]]:
    """Return the manifests of sets of a kind in a folder, at least one, in order of their names.

    Raises FileFormatError where there is none, and as `read_manifest`.
    """
    places = sorted(folder.glob(f"*{ENDING}"))
    manifests = [(place, read_manifest(place)) for place in places]
    chosen = [(place, manifest) for place, manifest in manifests if manifest.kind == kind]
    if not chosen:
        others = ", ".join(f"{place.name} of {manifest.kind}" for place, manifest in manifests)
        expected = f"one that ends in {ENDING}, as of a set of {kind}"
        where = f"{folder}: is a folder"
        raise FileFormatError(where, others or "no manifest", expected, "name a file")
    return chosen


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, as hex. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def wrong_files(
    folder: Path, records: Iterable[FileRecord], progress: Callable[[int], Any] = lambda rows: None
) -> dict[str, str]:
    """Return what is wrong with files, by their names; all processors read them.

    `progress` is called with the number of rows of each file that was read. Raises OSError.
    """

    def checked(record: FileRecord) -> tuple[FileRecord, str | None]:
        return record, _problem(folder / record.file, record)

    wrong = {}
    for record, problem in in_threads(checked, records, processors(), 2 * processors()):
        if problem is not None:
            wrong[record.file] = problem
        progress(record.rows)
    return wrong


def _problem(path: Path, record: FileRecord) -> str | None:
    if not path.is_file():
        return "is missing"
    if path.stat().st_size != record.bytes:
        return f"has {path.stat().st_size} bytes, not {record.bytes}"
    if file_sha256(path) != record.sha256:
        return "has another SHA-256 than the manifest says"
    return None

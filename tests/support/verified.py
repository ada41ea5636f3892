"""Checks of files of rooms, as `scenegen verify` makes them."""

from scenegen.files.manifest import manifest_path, read_manifest
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.verify import verify_file, verify_set


def checks_of(path, items=8, objects=None):
    """Return the checks of a file's values."""
    with RoomsFile(path) as rooms:
        return verify_file(rooms, items, objects=objects)


def checks_of_set(path, items=8):
    """Return the checks of a set against its manifest."""
    manifest = read_manifest(manifest_path(path))
    with RoomsFile(path) as rooms:
        return verify_set(rooms, manifest, items)

"""Checks of files of rooms, as `scenegen verify` makes them."""

from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.verify import verify_file


def checks_of(path, items=8, objects=None):
    """Return the checks of a file's values."""
    with RoomsFile(path) as rooms:
        return verify_file(rooms, items, objects=objects)

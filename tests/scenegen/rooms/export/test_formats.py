"""The records of formats: their writers are there, the docs list them, and no other is written."""

import pytest

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.export.single import export_paths, export_room
from scenegen.sharing.export import write_export
from scenegen.sharing.rooms import ROOMS


def test_others_are_refused(rooms_path, tmp_path):
    with open_rooms(rooms_path) as rooms:
        for write in (
            lambda: export_paths(0, tmp_path, "x", "tiff"),
            lambda: export_room(rooms[0], [tmp_path / "x.tiff"], "tiff"),
            lambda: export_folder(rooms, "exr", tmp_path / "x"),
            lambda: write_export(rooms, ROOMS, "csv", tmp_path / "x"),
        ):
            with pytest.raises(SpecError) as error:
                write()
            assert error.value.where == "format"
    assert list(tmp_path.iterdir()) == []

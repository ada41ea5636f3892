"""The records of formats: their writers are there, the docs list them, and no other is written."""

import re
from pathlib import Path

import pytest

from scenegen import open_rooms
from scenegen.common.errors import SpecError
from scenegen.rooms.export.folder import export_folder
from scenegen.rooms.export.formats import DATA_FORMATS, FOLDER_FORMATS, FORMATS, ROW_FORMATS
from scenegen.rooms.export.single import export_paths, export_room
from scenegen.sharing.export import write_export
from scenegen.sharing.rooms import ROOMS

DOCS = Path(__file__).parents[4] / "docs"


@pytest.mark.parametrize("form", FORMATS.values(), ids=lambda form: form.name)
def test_each_has_a_writer(form):
    assert callable(form.load_writer())


def test_the_docs_have_a_row_or_column_of_each():
    page = (DOCS / "export.md").read_text()
    rows = re.findall(r"^\| `(\w+)`(?:, with `\w+`)? \|", page, re.MULTILINE)
    assert rows == [*ROW_FORMATS, *FOLDER_FORMATS]
    columns = [f"`{name}`" for name in DATA_FORMATS]
    assert f"| | {' | '.join(columns)} |" in (DOCS / "sharing.md").read_text()


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

"""The layout of rooms files, as the page of it has it."""

from pathlib import Path

from scenegen.layout import csv_table

TABLE = Path(__file__).parents[2] / "docs" / "data" / "rooms-columns.csv"


def test_the_page_has_all_columns():
    anew = "write what `python -m scenegen.layout` prints to docs/data/rooms-columns.csv"
    assert TABLE.read_text() == csv_table(), anew

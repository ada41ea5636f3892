"""Cards are written from a description alone, and a person tells only what can be published."""

import pytest
import yaml

from scenegen.common.errors import SpecError
from scenegen.files.schema import Column
from scenegen.sharing.card import DataDescription, Publication, SharedFile, card_page
from scenegen.sharing.croissant import croissant_json

GOOD = {"title": "t", "creators": ("A",), "date": "2026-01-31", "license": "CC-BY-4.0"}
TOLD = Publication("A {b} c%", ("D & E",), "2025-12-01", "https://x.org/terms")
FILES = [
    SharedFile("a b.h5", "application/x-hdf5", "sums", 12, "0" * 64),
    SharedFile("index.parquet", "application/x-parquet", "sums", 12, "0" * 64),
]
SUMS = DataDescription(
    summary="Sums of numbers.",
    keywords=("sums",),
    files=(),
    columns=(Column("sum", (-1, 3), "int64", meaning="of the numbers"),),
    key=("sum",),
    rows=20_000,
    facts={"Counts": [("what", "how many"), ("a|b", "<i>")]},
    commands={"a b.h5": "make `it`"},
    requests={},
    layout="",
    responsible={"data_limitations": ["They are small."]},
    notes={},
)


def test_the_page():
    _, head, page = card_page(TOLD, SUMS, FILES).split("---\n", 2)
    header = yaml.safe_load(head)
    assert (header["license"], header["license_link"]) == ("other", "https://x.org/terms")
    assert header["size_categories"] == ["10K<n<100K"]
    lines = page.splitlines()
    assert r"| a\|b | &lt;i&gt; |" in lines
    assert "    make `it`" in lines, "a block, in which nothing means anything"
    assert "| sum | int64 | (n, 3) | of the numbers |" in lines
    assert "- They are small." in lines
    assert "    @misc{a-b-c," in lines
    assert "      title = {A b c}," in lines
    assert "      author = {{D  E}}," in lines


def test_names_of_files_in_croissant():
    text = croissant_json(TOLD, SUMS, FILES)
    assert '"contentUrl": "a%20b.h5"' in text
    assert '"cr:arrayShape": "-1,3"' in text


@pytest.mark.parametrize(
    ("wrong", "where"),
    [
        ({"title": " "}, "title"),
        ({"creators": ()}, "creator"),
        ({"creators": ("A", "")}, "creator"),
        ({"date": "2026-02-30"}, "date"),
        ({"date": "20260130"}, "date"),
        ({"license": "do as you like"}, "license"),
        ({"license": "https://x.org/><script>"}, "license"),
        ({"version": "1.0"}, "data-version"),
        ({"url": "javascript:alert(1)"}, "url"),
    ],
)
def test_what_cannot_be_published(wrong, where):
    with pytest.raises(SpecError) as error:
        Publication(**{**GOOD, **wrong})
    assert error.value.where == where


@pytest.mark.parametrize(
    ("license_", "address"),
    [
        ("CC0-1.0", "https://spdx.org/licenses/CC0-1.0.html"),
        ("https://x.org/terms", "https://x.org/terms"),
    ],
)
def test_where_a_licence_can_be_read(license_, address):
    assert Publication(**{**GOOD, "license": license_}).license_address == address

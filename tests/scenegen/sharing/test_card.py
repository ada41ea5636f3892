"""The page of data that is not about rooms: it is written from the description alone."""

import yaml

from scenegen.sharing.card import card_markdown
from scenegen.sharing.croissant import croissant_json
from scenegen.sharing.description import DataDescription, IndexColumn, Publication, SharedFile

TOLD = DataDescription(
    publication=Publication("A {b} c%", ("D & E",), "2025-12-01", "https://x.org/terms"),
    summary="Sums of numbers.",
    keywords=("sums",),
    files=(SharedFile("a b.h5", "application/x-hdf5", "sums", 12, "0" * 64),),
    index=(IndexColumn("sum", "Int64", "of the numbers", (-1, 3)),),
    index_file="index.parquet",
    rows=20_000,
    facts={"Counts": [("what", "how many"), ("a|b", "<i>")]},
    commands={"a b.h5": "make `it`"},
    requests={},
    layout="",
    responsible={"dataLimitations": ["They are small."]},
)


def test_the_page():
    _, head, page = card_markdown(TOLD).split("---\n", 2)
    header = yaml.safe_load(head)
    assert (header["license"], header["license_link"]) == ("other", "https://x.org/terms")
    assert header["size_categories"] == ["10K<n<100K"]
    lines = page.splitlines()
    assert r"| a\|b | &lt;i&gt; |" in lines
    assert "    make `it`" in lines, "a block, in which nothing means anything"
    assert "| sum | Int64 | (n, 3) | of the numbers |" in lines
    assert "- They are small." in lines
    assert "    @misc{a-b-c," in lines
    assert "      title = {A b c}," in lines
    assert "      author = {{D  E}}," in lines


def test_names_of_files_in_croissant():
    text = croissant_json(TOLD)
    assert '"contentUrl": "a%20b.h5"' in text
    assert '"arrayShape": "-1,3"' in text

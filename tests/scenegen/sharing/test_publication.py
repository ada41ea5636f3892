"""A person tells only what can be published, and texts mean nothing to TeX."""

import pytest

from scenegen.common.errors import SpecError
from scenegen.sharing.publication import Publication

GOOD = {"title": "t", "creators": ("A",), "date": "2026-01-31", "license": "CC-BY-4.0"}


def test_a_citation_and_where_the_licence_can_be_read():
    told = Publication("A {b} c%", ("D & E",), "2025-12-01", "https://x.org/terms")
    lines = told.citation.splitlines()
    assert lines[0] == "@misc{a-b-c,"
    assert {"  title = {A b c},", "  author = {{D  E}},", "  year = {2025},"} < set(lines)
    assert told.license_address == "https://x.org/terms"
    assert Publication(**GOOD).license_address == "https://spdx.org/licenses/CC-BY-4.0.html"


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

"""What a person may tell of data that is published."""

import pytest

from scenegen.common.errors import SpecError
from scenegen.sharing.description import Publication

GOOD = {"title": "t", "creators": ("A",), "date": "2026-01-31", "license": "CC-BY-4.0"}


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
def test_refused(wrong, where):
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

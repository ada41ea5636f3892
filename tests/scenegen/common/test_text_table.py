"""Names and numbers as cells: whatever they hold, one cell that shows it."""

import html
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenegen.common.text_table import distinct, markdown, number, plain, printable

ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=30)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\x1b[2J\r\nb\x9b\x00", r"a\x1b[2J\r\nb\x9b\x00"),
        ("abc\u202edef \ud800 \u2028", r"abc\u202edef \ud800 \u2028"),
        ("日本語 é 🎲 C:\\x " + 90 * "y", "日本語 é 🎲 C:\\x " + 90 * "y"),
    ],
)
def test_what_a_terminal_would_obey_is_shown(text, shown):
    assert printable(text) == shown
    assert printable(text, keep=text) == text


@given(ANY_TEXT)
def test_any_name_is_one_cell_in_every_format(name):
    text = plain(name)
    assert 0 < len(text) <= 60
    assert text.encode()
    assert len(text.splitlines()) == 1
    cell = markdown(text)
    assert not re.search(r"(?<!\\)(?:\\\\)*\|", cell)
    assert not re.search(r"[<>]", cell)
    back = re.sub(r"\\([\\`*_\[\]|~$])", r"\1", cell)
    assert html.unescape(back) == text


@pytest.mark.parametrize(
    ("value", "ends", "shown"),
    [
        (0.0, None, "0"),
        (-0.0, None, "0"),
        (0.5519, None, "0.5519"),
        (0.1, None, "0.1000"),
        (12.3456, None, "12.35"),
        (99999.9, None, "100000"),
        (-0.012344, None, "-0.01234"),
        (1.5e-5, None, "0.00001500"),
        (1.5e-9, None, "1.5e-09"),
        (-1.2e-15, (-2.6e-15, 9e-17), "0"),
        (1e99, None, "1e+99"),
        (0.5969, (0.54, 0.64), "0.60"),
        (0.9696, (0.9690, 0.9701), "0.9696"),
        (-1e-9, (-0.01, 0.01), "0.000"),
        (0.25, (0.25, 0.25), "0.2500"),
        (1234.56, (1200.0, 1260.0), "1235"),
        (1e99, (0.1, 0.2), "1e+99"),
    ],
)
def test_numbers(value, ends, shown):
    assert number(value, ends or (None, None)) == shown


@given(st.floats(1e-5, 1e6, exclude_max=True))
def test_four_digits_are_kept(value):
    assert math.isclose(float(number(value)), value, rel_tol=5.1e-4)
    assert "e" not in number(value)


def test_names_that_are_alike_are_told_apart():
    assert distinct(["a", "b"], ["x", "y"]) == ["a", "b"]
    assert distinct(["a", "b", "a"], ["x", "y", "z"]) == ["a [x]", "b", "a [z]"]
    assert distinct(["a", "a"], ["", "x"]) == ["a [(unnamed)]", "a [x]"]
    assert distinct(["a", "a\n", "b"], ["x", "x", "x"]) == ["a [x] #1", "a [x] #2", "b"]

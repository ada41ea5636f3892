"""Names and numbers as cells: whatever they hold, one cell that shows it."""

import html as html_module
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenegen.common.text_table import (
    aligned,
    distinct,
    html,
    latex,
    markdown,
    number,
    piped,
    plain,
)

ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=30)


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("Pix2Shape", "Pix2Shape"),
        ("", "(unnamed)"),
        (" \n\t\u3000", "(unnamed)"),
        ("\u202e\u2066", "(unnamed)"),
        ("a\nb\r\n c\u2028d\x85e", "a b c d e"),
        ("a\x00b\x1b[31m\ud800", "a\ufffdb\ufffd[31m\ufffd"),
        ("abc\u202edef", "abcdef"),
        ("日本語 é 🎲", "日本語 é 🎲"),
        ("x" * 60, "x" * 60),
        ("x" * 61, "x" * 57 + "..."),
    ],
)
def test_names_in_one_line(name, shown):
    assert plain(name) == shown


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
    assert html_module.unescape(back) == text
    assert html_module.unescape(html(text)) == text
    assert not re.search(r"[<>\"']", html(text))


def test_entities_and_dashes_show_as_they_are():
    assert markdown("&lt;b&gt; &amp; <b>") == "&amp;lt;b&amp;gt; &amp;amp; &lt;b&gt;"
    assert latex("a-b--c---d") == "a-b-{}-c-{}-{}-d"


SPECIAL = {
    r"\textbackslash{}": "\\",
    r"\textasciitilde{}": "~",
    r"\textasciicircum{}": "^",
    r"\textless{}": "<",
    r"\textgreater{}": ">",
    r"\textbar{}": "|",
    r"{\char34}": '"',
    r"\textasciigrave{}": "`",
    r"\textquotesingle{}": "'",
}


@given(st.text(st.sampled_from("\\{}%#$&_^~<>|\"'`-[]ab é"), max_size=12))
def test_latex_is_read_back_by_its_own_rules(text):
    """A small reader of the few commands that are written, which knows no others."""
    found, rest = "", latex(text)
    while rest:
        for command, character in SPECIAL.items():
            if rest.startswith(command):
                found, rest = found + character, rest.removeprefix(command)
                break
        else:
            if rest[0] == "\\":
                assert rest[1] in "&%$#_{}", rest
                found, rest = found + rest[1], rest[2:]
            elif rest.startswith("{}"):
                rest = rest[2:]
            else:
                assert rest[0] not in "{}%#$&_^~\"'`<>|", rest
                found, rest = found + rest[0], rest[1:]
    assert found == text
    assert "--" not in latex(text)


@pytest.mark.parametrize(
    ("value", "like", "shown"),
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
        (1e99, None, "1e+99"),
        (0.04, 0.1234, "0.0400"),
        (-1e-9, 0.1234, "0.0000"),
        (0.25, 0.0, "0.2500"),
        (123.456, 0.1, "123.4560"),
        (1e99, 0.1, "1e+99"),
    ],
)
def test_numbers(value, like, shown):
    assert number(value, like) == shown


@given(st.floats(1e-5, 1e6, exclude_max=True))
def test_four_digits_are_kept(value):
    assert math.isclose(float(number(value)), value, rel_tol=5.1e-4)
    assert "e" not in number(value)


def test_names_that_are_alike_are_told_apart():
    assert distinct(["a", "b"], ["x", "y"]) == ["a", "b"]
    assert distinct(["a", "b", "a"], ["x", "y", "z"]) == ["a [x]", "b", "a [z]"]
    assert distinct(["a", "a"], ["", "x"]) == ["a [(unnamed)]", "a [x]"]
    assert distinct(["a", "a\n", "b"], ["x", "x", "x"]) == ["a [x] #1", "a [x] #2", "b"]


def test_columns_are_aligned_by_what_terminals_show():
    assert aligned([("日本", "x"), ("abcde", "y"), ("e\u0301", "z")]) == [
        "日本   x",
        "abcde  y",
        "e\u0301      z",
    ]
    assert piped([("a", "b"), ("c", "d")]) == ["| a | b |", "| --- | --- |", "| c | d |"]

"""One table in four formats, with texts that would like to break them."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pages import Page

from metrics.views.page import Section, html_page
from metrics.views.table import (
    Cell,
    Table,
    latex,
    make_row,
    make_table,
    to_latex,
    to_markdown,
    to_text,
)
from scenegen.common.text_table import printable

HOSTILE = [
    "a | b",
    "under_score & amp; 100% #1 $x^2$ {braces} ~",
    "<script>alert(1)</script>",
    "\"><img src=x onerror='alert(1)'>",
    "two\nlines\r\n| --- |",
    "\\input{/etc/passwd} \\\\ \\end{tabular}",
    "**bold** `code` [link](javascript:alert(1)) ![x](http://x.y/z.png)",
    "日本語 🎲 é",
    "\u202eright to left\u2066",
    "\x00\x1b[2J\ud800",
    "",
    "</title></style><!--",
]


@pytest.fixture(scope="module")
def hostile():
    """A table of which every part is hostile."""
    rows = [make_row([str(i), text, Cell(text, text)]) for i, text in enumerate(HOSTILE)]
    rows.append(make_row(["", "the room", "0"], "baseline"))
    head = ("#", HOSTILE[0], HOSTILE[2])
    return Table(HOSTILE[5], head, tuple(rows), tuple(HOSTILE), named_by=1)


def test_html_holds_texts_of_others_as_texts(hostile):
    page = Page(html_page(hostile.title, [Section(HOSTILE[3], HOSTILE, tables=[hostile])]))
    assert page.tags.isdisjoint({"script", "img", "iframe", "form", "object"})
    assert not any(name.startswith("on") or name == "src" for name in page.attributes)
    assert page.addresses == ["data:,"]
    assert set(map(len, page.rows)) == {3}
    assert [row[1] for row in page.rows[1:-1]] == [printable(t, keep="\n\t") for t in HOSTILE]


def test_markdown_rows_have_all_their_cells_and_no_markup_of_others(hostile):
    text = to_markdown(HOSTILE[2], [hostile], HOSTILE)
    assert "<" not in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + len(hostile.rows)
    assert {len(re.findall(r"(?<!\\)(?:\\\\)*\|", row)) for row in rows} == {4}
    assert r"\[link\](javascript:alert(1)) !\[x\]" in text


def test_latex_has_balanced_braces_and_all_its_cells(hostile):
    text = to_latex([hostile, make_table("simple", ["a"], [["b"]])])
    bare = re.sub(r"\\[\\{}%$#_&]", "", text.split("\n", 1)[1])
    assert bare.count("{") == bare.count("}")
    assert not re.search(r"(?<!\{)%", bare)  # but for \resizebox{...}{!}{%
    assert {"$", "#"}.isdisjoint(bare)
    assert {"\\input", "\\end{tabular} "}.isdisjoint(re.findall(r"\\\w+", text))
    tabular = text.split(r"\begin{tabular}{rlc}")[1].split(r"\end{tabular}")[0]
    ends = [line for line in tabular.splitlines() if line.endswith(r" \\")]
    assert {len(re.findall(r"(?<!\\)&", row)) for row in ends} == {2}
    assert len(ends) == 1 + len(hostile.rows)
    assert tabular.count(r"\midrule") == 2, "one below the head, one before the baseline"


def test_text_stays_within_its_lines(hostile):
    lines = to_text(HOSTILE[2], [hostile], HOSTILE).splitlines()
    assert all(line.isprintable() for line in lines)
    assert len(lines) == 1 + 1 + 2 + len(hostile.rows) + len(HOSTILE), "each note once"
    starts = {line.index("the room") for line in lines if "the room" in line}
    starts |= {line.index(printable(HOSTILE[0])) for line in lines[4:] if line.startswith("  0 ")}
    assert len(starts) == 1, "columns are aligned"


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
    characters, rest = "", latex(text)
    while rest:
        for command, character in SPECIAL.items():
            if rest.startswith(command):
                characters, rest = characters + character, rest.removeprefix(command)
                break
        else:
            if rest[0] == "\\":
                assert rest[1] in "&%$#_{}", rest
                characters, rest = characters + rest[1], rest[2:]
            elif rest.startswith("{}"):
                rest = rest[2:]
            else:
                assert rest[0] not in "{}%#$&_^~\"'`<>|", rest
                characters, rest = characters + rest[0], rest[1:]
    assert characters == text
    assert "--" not in latex(text)

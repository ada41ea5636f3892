"""One table in four formats, with texts that would like to break them."""

import re
import shutil
import subprocess
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pages import Page, cells_of

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
    without_rests,
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
TAGS = {"h2", "html", "head", "meta", "title", "style", "body", "h1", "div", "bdi", "small", "main"}
TAGS |= {"table", "thead", "tbody", "tr", "th", "td", "ul", "li", "link"}
ATTRIBUTES = {"lang", "charset", "name", "content", "class", "scope", "http-equiv", "rel", "href"}
ATTRIBUTES |= {"role", "aria-label", "tabindex"}


@pytest.fixture(scope="module")
def hostile():
    """A table of which every part is hostile."""
    rows = [make_row([str(i), text, Cell(text, text)]) for i, text in enumerate(HOSTILE)]
    rows.append(make_row(["", "the room", "0"], "baseline"))
    head = ("#", HOSTILE[0], HOSTILE[2])
    return Table(HOSTILE[5], head, tuple(rows), tuple(HOSTILE), named_by=1)


def test_html_holds_nothing_but_its_own_tags(hostile):
    text = html_page(hostile.title, [Section("", tables=[hostile])])
    page = Page(text)
    assert page.tags <= TAGS
    assert page.attributes <= ATTRIBUTES
    assert page.addresses == ["data:,"]
    assert set(map(len, page.rows)) == {3}
    assert [row[1] for row in page.rows[1:-1]] == [printable(t, keep="\n\t") for t in HOSTILE]
    assert text.startswith("<!doctype html>")


def test_markdown_rows_have_all_their_cells_and_no_markup_of_others(hostile):
    text = to_markdown(HOSTILE[2], [hostile], HOSTILE)
    assert "<" not in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + len(hostile.rows)
    assert {len(re.findall(r"(?<!\\)(?:\\\\)*\|", row)) for row in rows} == {4}
    assert r"\[link\](javascript:alert(1)) !\[x\]" in text
    assert r"\*\*bold\*\* \`code\`" in text
    assert text.count("\n- ") == len(HOSTILE), "each note once"


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


def test_latex_compiles(hostile, tmp_path):
    if shutil.which("pdflatex") is None:
        pytest.skip("no pdflatex")
    rows = [make_row([c.value for c in row.cells]) for row in hostile.rows if str(row).isascii()]
    tables = [replace(hostile, rows=tuple(rows), notes=()), make_table("±°↑↓≈†‡", ["a"], [["1"]])]
    written = to_latex(map(without_rests, tables), "tab:a")
    assert re.findall(r"\\label{(.*)}", written) == ["tab:a", "tab:a-2"]
    packages = r"\documentclass{article}\usepackage{booktabs,graphicx,textcomp}\begin{document}"
    (tmp_path / "t.tex").write_text(f"{packages}\n{written}\n\\end{{document}}\n")
    command = ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "t.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:]


def test_text_stays_within_its_lines(hostile):
    lines = to_text(HOSTILE[2], [hostile], HOSTILE).splitlines()
    assert all(line.isprintable() for line in lines)
    assert len(lines) == 1 + 1 + 2 + len(hostile.rows) + len(HOSTILE), "each note once"
    starts = {line.index("the room") for line in lines if "the room" in line}
    starts |= {line.index(printable(HOSTILE[0])) for line in lines[4:] if line.startswith("  0 ")}
    assert len(starts) == 1, "columns are aligned"


def test_each_format_marks_the_best_and_rows_of_other_kinds():
    rows = (
        make_row(["1", "first", Cell("0.10", "[0.09]", best=True)]),
        make_row(["", "none", "0.20"], "baseline"),
    )
    table = Table("t", ("#", "method", "score"), rows, named_by=1)
    marked = [" ".join(line.split()) for line in to_markdown("", [table]).splitlines()[4:]]
    assert marked == [r"| 1 | first | **0.10** \[0.09\] |", "| | *none* | 0.20 |"]
    written = to_latex([table])
    shown = [" ".join(line.split()) for line in written.splitlines()]
    assert r"1 & first & \textbf{0.10} [0.09] \\" in shown
    assert r"& \emph{none} & 0.20 \\" in shown
    page = html_page("x", [Section("", tables=[table])])
    assert re.search(r'<td class="best"><bdi>0.10</bdi><small>\[0.09\]</small>', page)
    assert re.search(r'<tr class="baseline">\s*<td><bdi></bdi></td>\s*<th scope="row">', page)
    assert to_text("x", [table]).splitlines() == [
        "x", "", "t", "  #  method  score", "  1  first   0.10 [0.09]", "     none    0.20",
    ]  # fmt: skip
    narrow = replace(table, head=("#", "the method", "score"))
    assert to_text("", [narrow], width=20).splitlines()[1:3] == [
        "  #  the     score",
        "     method",
    ]
    assert cells_of(table) == {"first": ["0.10 [0.09]"], "none": ["0.20"]}


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


LONG = "A sentence of many words, " * 9


def test_notes_are_told_once_and_wrapped_in_text():
    some = replace(make_table("t", ("a",), [["1"]]), notes=(LONG, "short"))
    for write in (to_text, to_markdown):
        text = write("title", [some, some], [LONG, "last"])
        assert [text.count(LONG.strip()), text.count("short"), text.count("last")] == [1, 1, 1]
    lines = to_text("title", [some], [], 60).splitlines()
    assert max(map(len, lines)) <= 60
    assert " ".join(" ".join(lines).split()).count(LONG.strip()) == 1

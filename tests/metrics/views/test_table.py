"""Leaderboards in Markdown, HTML and LaTeX, with names that would like to break them."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_scores import iqtt_scores, rooms_scores, stated
from markupsafe import escape
from pages import Page

from metrics.views.leaderboard.ranking import leaderboard
from metrics.views.table import latex, to_html, to_latex, to_markdown
from metrics.score_file import Skill
from scenegen.common.text_table import markdown, plain

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
def board():
    files = [
        rooms_scores(
            name,
            {"chamfer": [0.1 + i / 100] * 2, "hausdorff": [0.5] * 2, "mse_depth": [0.02] * 2},
            [0, 1],
            runs=1 + i % 2,
            comparable=i != 3,
        )
        for i, name in enumerate(HOSTILE)
    ]
    questions = iqtt_scores("simple", [1, 0, 1])
    (group,) = questions.by_distractor.values()
    skills = {"iqtt_accuracy": Skill(0.5, 0.4, 0.6, 1 / 3, HOSTILE[4] + HOSTILE[2] + "\x1b")}
    kinds = dict.fromkeys(("near | far", "\x1b[2J", "<img src=x>"), group)
    return leaderboard([*files, stated(questions, skills=skills, by_distractor=kinds)])


TAGS = {"html", "head", "meta", "title", "style", "body", "h1", "h2", "div", "bdi", "small"}
TAGS |= {"table", "thead", "tbody", "tr", "th", "td", "ul", "li", "link", "main"}
ATTRIBUTES = {"lang", "charset", "name", "content", "class", "scope", "http-equiv", "rel", "href"}
ATTRIBUTES |= {"role", "data-head", "aria-label"}


def test_html_holds_nothing_but_its_own_tags(board):
    text = to_html(board)
    page = Page(text)
    assert page.tags <= TAGS
    assert page.attributes <= ATTRIBUTES
    assert page.addresses == ["data:,"]
    assert "url(" not in text
    assert "@import" not in text
    labels = [row[1] for row in page.rows]
    for i, name in enumerate(HOSTILE):
        told = " (2 runs)" if i % 2 else ""
        assert plain(name) + told + (" ‡" if i == 3 else "") in labels
    widths = [len(row) for row in page.rows[: len(HOSTILE) + 1]]
    assert set(widths) == {5}
    assert text.encode().decode() == text
    for shown in (text, to_markdown(board), to_latex(board)):
        assert "\x1b" not in shown
        assert "floor: two lines" in shown


def test_the_best_are_marked_in_each_format(board):
    first = HOSTILE[0]
    row = next(
        line for line in to_html(board).splitlines() if f"<bdi>{escape(first)}</bdi>" in line
    )
    assert re.search(r'</th><td [^>]*class=" best"><div>0.1000<small> \[0.1000,', row)
    assert f"| 1 | {markdown(first)} | **0.1000** \\[0.1000" in to_markdown(board)
    assert rf"1 & {latex(first)} & \textbf{{0.1000}} [0.1000" in to_latex(board)
    for text, mark in ((to_html(board), 'best"><div>0.1300'), (to_markdown(board), "**0.1300")):
        assert mark not in text


def test_markdown_rows_have_all_their_cells_and_no_markup_of_others(board):
    text = to_markdown(board)
    assert "<" not in text
    for block in text.split("\n\n"):
        rows = [line for line in block.splitlines() if line.startswith("|")]
        bars = {len(re.findall(r"(?<!\\)(?:\\\\)*\|", row)) for row in rows}
        assert len(bars) <= 1, rows
    body = text.split("\n\n")[1].splitlines()
    assert len(body) == 2 + len(HOSTILE) + 4  # the paper's four rows of Table 1
    assert r"\[link\](javascript:alert(1)) !\[x\]" in text
    assert r"\*\*bold\*\* \`code\`" in text
    assert f"*{markdown(plain(HOSTILE[3]))} (2 runs) ‡*" in text
    assert "‡ not comparable" in text


def test_latex_has_balanced_braces_and_all_its_cells(board):
    text = to_latex(board)
    bare = re.sub(r"\\[\\{}%$#_&]", "", text.split("\n", 1)[1])
    assert bare.count("{") == bare.count("}")
    assert not re.search(r"(?<!\{)%", bare)  # but for \resizebox{...}{!}{%
    assert "$" not in bare
    assert "#" not in bare
    assert text.count(r"\begin{table}") == text.count(r"\end{table}") == len(board)
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}}")
    assert {"\\input", "\\end{tabular} ", "\\write"}.isdisjoint(re.findall(r"\\\w+", text))
    for tabular in text.split(r"\begin{tabular}")[1:]:
        layout, rows = tabular.split("}", 1)
        ends = [line for line in rows.splitlines() if line.endswith(r" \\")]
        assert {len(re.findall(r"(?<!\\)&", row)) for row in ends} == {len(layout) - 2}
        assert ends
    assert "XeLaTeX or LuaLaTeX" in text.splitlines()[0]
    simple = to_latex(leaderboard([iqtt_scores("simple", [1, 0])], paper="none"))
    assert simple.isascii()
    assert simple.startswith("% needs \\usepackage{booktabs,graphicx,textcomp}\n")


def test_the_papers_figures_are_marked_in_each_format(board):
    assert "*Pix2Shape, Shape scenes (Table 1) †*" in to_markdown(board)
    assert r"\emph{Pix2Shape, Shape scenes (Table 1) \textdagger{}}" in to_latex(board)
    page = to_html(board)
    rows = re.findall(r"<tr role=\"row\" class=\"([^\"]*)\">.*?<bdi>(.*?)</bdi>", page)
    for classes, label in rows:
        assert ("reported" in classes) == label.endswith("†")
        assert ("incomparable" in classes) == label.endswith("‡")
    for text in (to_markdown(board), page, to_latex(board)):
        assert re.search(r"0\.7329(<small>)? (±|\\ensuremath\{\\pm\}) 0\.148", text)
        assert "0.1969" in text


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
    assert latex("c---d") == "c-{}-{}-d"

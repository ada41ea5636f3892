"""Every kind of page in a real browser."""

from dataclasses import replace

import numpy as np
import pytest
from made_scores import iqtt_scores, simple_rooms
from pages import Page

from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.scoring.evaluate import open_runs, score
from metrics.views.compare.compare import compare
from metrics.views.compare.report import html_report as html_comparison
from metrics.views.leaderboard import leaderboard, to_html
from metrics.views.page import Section, html_page
from metrics.views.report import html_report
from scenegen.rooms.reader import RoomsFile

HOSTILE = "<img src=x onerror=alert(1)>\u202e" + "W" * 90 + "|" + "y" * 60
LARGEST = 3_000_000  # bytes

# What sticks out of the window, except in tables, which scroll by themselves.
OUTSIDE = """() => {
  const wide = document.documentElement.clientWidth;
  return [...document.querySelectorAll('body *')]
    .filter(e => e.checkVisibility() && !e.closest('.scroll *'))
    .map(e => [e, e.getBoundingClientRect()])
    .filter(([, box]) => box.right > wide + 1 || box.left < -1)
    .map(([e]) => e.tagName + ' ' + e.textContent.slice(0, 40));
}"""


@pytest.fixture(scope="module")
def pages(make_rooms, truths, tmp_path_factory):
    """Paths of pages by what they are; their methods have hostile names."""
    folder = tmp_path_factory.mktemp("pages")
    rooms = make_rooms(folder / "rooms.h5", 3, views=(0.0, 1.0, 80.0))
    files = []
    for i, name in enumerate(("flat", HOSTILE)):
        path = folder / f"{i}.h5"
        with RoomsFile(rooms) as truth, RoomPredictionWriter(path, rooms, method="m") as out:
            for row in range(len(truth)):
                depth = truth.read("depth", row)
                out.add(row, np.nan_to_num(depth, nan=1.0) * (1 + 0.1 * (i + row % 3)))
        files.append(replace(score([path], rooms), method=name))
    answers = truths.iqtt.with_name("iqtt-test-answers.h5")
    write_answers(folder / "q.h5", truths.iqtt, method="m", answer=np.arange(6) % 3)
    questions = replace(score([folder / "q.h5"], answers), method=HOSTILE)
    with (
        open_runs([folder / "1.h5"], rooms) as runs,
        open_runs([folder / "q.h5"], answers) as asked,
    ):
        made = {
            "rooms": html_report(files[1], runs, files[:1]),
            "questions": html_report(questions, asked, [questions]),
        }
    made |= {
        "little": html_report(iqtt_scores("one", [1.0])),
        "compared": html_comparison(compare(files), files),
        "ranked": to_html(leaderboard([*files, questions, simple_rooms("other")])),
    }
    for name, text in made.items():
        assert len(text) < LARGEST
        (folder / f"{name}.html").write_text(text)
    return {name: folder / f"{name}.html" for name in made}


def test_pages_fit_a_phone_and_stay_silent(visit, pages):
    for name, path in pages.items():
        seen = visit(path.as_uri(), width=360, color_scheme="dark")
        seen.page.evaluate("document.querySelectorAll('details').forEach(d => d.open = 1)")
        assert seen.page.evaluate(OUTSIDE) == [], name
        assert seen.violations() == [], name
        assert seen.page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth)")


def test_tables_of_a_leaderboard_are_sorted_at_a_click(visit, pages):
    seen = visit(pages["ranked"].as_uri())
    table = seen.page.locator("table").first
    column = table.locator("tbody tr :nth-child(3) bdi")
    table.locator("th button").nth(2).click()
    numbers = [float(n) for n in column.all_inner_texts() if n not in ("", "-")]
    assert numbers == sorted(numbers)


def test_sections_hold_texts_of_others_as_texts():
    section = Section(HOSTILE, remarks=[HOSTILE], notes=[HOSTILE], charts=[(HOSTILE, "data:,")])
    text = html_page(HOSTILE, [section], warnings=[HOSTILE])
    assert text.count("<img") == 1
    assert Page(text).text.count(HOSTILE.replace("\u202e", "\\u202e")) == 7

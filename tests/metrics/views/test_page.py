"""Every kind of page in a real browser: on a phone and a screen, light and dark, and on paper."""

from dataclasses import replace

import numpy as np
import pytest
from made_scores import iqtt_scores, simple_rooms
from pages import Page

from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.scoring.evaluate import open_runs, score
from metrics.views.compare.compare import compare
from metrics.views.compare.report import html_report as html_comparison
from metrics.views.leaderboard.ranking import leaderboard, to_html
from metrics.views.page import Lead, Section, html_page
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


@pytest.mark.parametrize(
    ("width", "scheme", "names"),
    [
        (360, "dark", ("rooms", "questions", "compared", "ranked")),
        (1280, "light", ("rooms",)),
        pytest.param(360, "dark", ("little",), marks=pytest.mark.slow),
    ],
)
def test_pages_fit_read_well_and_stay_silent(visit, pages, width, scheme, names):
    for name in names:
        seen = visit(pages[name].as_uri(), width=width, color_scheme=scheme)
        seen.page.evaluate("document.querySelectorAll('details').forEach(d => d.open = 1)")
        assert seen.page.evaluate(OUTSIDE) == [], name
        assert seen.page.evaluate("document.documentElement.scrollWidth") <= width, name
        assert seen.violations() == [], name
        assert seen.page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth)")


def test_folded_numbers_are_printed(visit, pages):
    seen = visit(pages["rooms"].as_uri())
    table = seen.page.get_by_role("group", name="all scores")
    assert not table.is_visible()
    seen.page.emulate_media(media="print")
    assert table.is_visible()


def test_tables_of_a_leaderboard_are_sorted_at_a_click_and_pictures_enlarged(visit, pages):
    seen = visit(pages["ranked"].as_uri())
    table = seen.page.locator("table").first
    column = table.locator("tbody tr :nth-child(3) bdi")
    table.locator("th button").nth(2).click()
    numbers = [float(n) for n in column.all_inner_texts() if n not in ("", "-")]
    assert numbers == sorted(numbers)
    seen = visit(pages["rooms"].as_uri())
    picture = seen.page.locator(".pictures label").first
    for wide in (1280, 200):
        picture.locator("input").click()
        assert abs(picture.locator("img").bounding_box()["width"] - wide) < 20


def test_sections_hold_texts_of_others_as_texts():
    leads = [Lead(HOSTILE, HOSTILE)]
    section = Section(HOSTILE, remarks=[HOSTILE], notes=[HOSTILE])
    page = Page(html_page(HOSTILE, [section], leads=leads, warnings=[HOSTILE]))
    assert "img" not in page.tags
    assert page.text.count(HOSTILE.replace("\u202e", "\\u202e")) == 8

"""Every kind of page in a real browser, at three widths, light and dark, and on paper."""

import re
from dataclasses import replace

import numpy as np
import pytest
from made_scores import iqtt_scores, simple_rooms

from metrics.views.compare.compare import compare
from metrics.views.compare.report import html_comparison
from metrics.views.leaderboard.ranking import leaderboard
from metrics.views.leaderboard.site import write_site
from metrics.views.table import to_html
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.views.report import html_report
from metrics.scoring.evaluate import score
from scenegen.rooms.reader import RoomsFile

HOSTILE = "<img src=x onerror=alert(1)>\u202e" + "W" * 90 + "|" + "y" * 60
VIEWS = (0.0, 1.0, 35.0, 80.0)
LARGEST = 3_000_000  # bytes

# What sticks out of the window, scrolls inside, is cut off, or lies on something else.
WRONG = """() => {
  const found = [], wide = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth > wide) found.push('the page scrolls');
  const seen = [...document.querySelectorAll('body *')].filter(e => e.checkVisibility());
  for (const e of seen) {
    if (e.closest('thead')) continue;
    if (e.closest('svg *')) continue;  // letters in drawings: below
    const box = e.getBoundingClientRect();
    if (box.right > wide + 1 || box.left < -1)
      found.push('outside: ' + e.tagName + ' ' + e.textContent.slice(0, 40));
    if (e.clientWidth && e.scrollWidth > e.clientWidth + 1)
      found.push('scrolls: ' + e.tagName + ' ' + e.textContent.slice(0, 40));
  }
  const on = (a, b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 2
    && b.top < a.bottom - 2;
  for (const svg of document.querySelectorAll('svg')) {
    const frame = svg.getBoundingClientRect();
    const texts = [...svg.querySelectorAll('text')].map(t => [t, t.getBoundingClientRect()]);
    texts.forEach(([text, box], i) => {
      if (box.left < frame.left - 1 || box.right > frame.right + 1)
        found.push('cut off: ' + text.textContent);
      for (const [other, its] of texts.slice(0, i))
        if (on(box, its)) found.push('on each other: ' + text.textContent + other.textContent);
    });
  }
  const kinds = 'td, th, figcaption, p, li, h1, h2, h3, summary, img';
  const leaves = seen
    .filter(e => e.matches(kinds) && !e.querySelector(kinds) && !e.closest('thead'))
    .map(e => [e, e.getBoundingClientRect()]).sort((a, b) => a[1].top - b[1].top);
  leaves.forEach(([leaf, box], i) => {
    for (let j = i + 1; j < leaves.length && leaves[j][1].top < box.bottom - 2; j++)
      if (on(box, leaves[j][1]))
        found.push('on each other: ' + leaf.textContent + ' / ' + leaves[j][0].textContent);
  });
  return found;
}"""


@pytest.fixture(scope="module")
def pages(make_rooms, truths, tmp_path_factory):
    """Paths of pages by what they are; their methods have hostile names."""
    folder = tmp_path_factory.mktemp("pages")
    rooms = make_rooms(folder / "rooms.h5", 7, views=VIEWS)
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
    asked = replace(score([folder / "q.h5"], answers), method=HOSTILE)
    made = {
        "rooms": html_report(files[1], rooms, [folder / "1.h5"], files[:1]),
        "questions": html_report(asked, answers, [folder / "q.h5"], [asked]),
        "little": html_report(iqtt_scores("one", [1.0]), folder, []),
        "compared": html_comparison(compare(files), files),
        "ranked": to_html(leaderboard([*files, asked, simple_rooms("other")])),
    }
    for name, text in made.items():
        assert len(text) < LARGEST
        (folder / f"{name}.html").write_text(text)
    write_site([*files, asked], folder / "site")
    found = {name: folder / f"{name}.html" for name in made}
    return found | {f"site-{n}": folder / "site" / f"{n}.html" for n in ("index", "gallery")}


NAMES = ("rooms", "questions", "little", "compared", "ranked", "site-index", "site-gallery")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 768, 1280])
def test_pages_fit_read_well_and_stay_silent(visit, pages, width, scheme):
    for name in NAMES:
        seen = visit(pages[name].as_uri(), width=width, color_scheme=scheme)
        for opened in (False, True):
            if opened:
                seen.page.evaluate("document.querySelectorAll('details').forEach(d => d.open = 1)")
            assert seen.page.evaluate(WRONG) == [], (name, opened)
        assert seen.violations() == [], name
        shown = seen.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (shown == "rgb(255, 255, 255)") == (scheme == "light")
        assert seen.page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth)")


def test_the_headline_is_on_the_first_screen(visit, pages):
    seen = visit(pages["rooms"].as_uri(), width=1280, height=800)
    box = seen.page.locator("table.headline").bounding_box()
    assert box["y"] + box["height"] < 800
    assert seen.page.locator("table.headline tbody tr").count() == 5
    assert not seen.page.get_by_role("table", name="All scores").is_visible()


def test_the_policy_stops_what_a_page_should_not_do(visit, pages):
    seen = visit(pages["little"].as_uri())
    seen.page.evaluate(
        "document.body.insertAdjacentHTML('beforeend', '<p id=x style=\"color: red\">x</p>')"
    )
    assert any("style" in error for error in seen.errors)
    seen.errors.clear()


def test_pages_print_on_a4_with_their_numbers(visit, pages, tmp_path):
    seen = visit(pages["rooms"].as_uri())
    seen.page.pdf(path=tmp_path / "x.pdf", prefer_css_page_size=True)
    printed = (tmp_path / "x.pdf").read_bytes()
    sizes = set(re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", printed))
    assert {(round(float(w)), round(float(h))) for w, h in sizes} == {(595, 842)}
    seen.page.emulate_media(media="print")
    assert seen.page.get_by_role("table", name="All scores").is_visible()


def test_links_of_a_site_lead_to_reports_and_back(visit, pages):
    seen = visit(pages["site-index"].as_uri())
    links = seen.page.locator("a").evaluate_all("all => all.map(a => a.getAttribute('href'))")
    folder = pages["site-index"].parent
    assert set(links) == {path.name for path in folder.iterdir()}
    for path in folder.glob("report-*.html"):
        report = visit(path.as_uri())
        assert report.page.locator("nav a").get_attribute("href") == "index.html"

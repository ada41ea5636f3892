"""The site of docs/: it builds strictly, shows what the code host shows, and asks nobody else."""

import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import pytest
import sites
from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
COUNTED = ("h1", "h2", "h3", "li", "tr", "td", "pre", "img")
LISTS = ("ul", "ol")
ALIKE = {"th": "td"}  # headers that name nothing are plain cells


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the folder of the built site."""
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    done = sites.build(ROOT, folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


class Article(HTMLParser):
    """Counts the elements of a page's own text, by the number of lists that they stand in."""

    def __init__(self, text):
        super().__init__()
        self.found, self.links, self.within, self.lists = Counter(), [], 0, 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.within += tag == "article"
        self.lists += tag in LISTS
        if self.within and ALIKE.get(tag, tag) in COUNTED:
            self.found[ALIKE.get(tag, tag), self.lists] += 1
        self.links += [v for k, v in attributes if k in ("href", "src") and v]

    def handle_endtag(self, tag):
        self.within -= tag == "article"
        self.lists -= tag in LISTS


def built(site, path):
    place = path.relative_to(ROOT).as_posix().removeprefix("docs/").replace("README", "index")
    return site / place.replace(".md", ".html")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_a_page_has_the_lists_tables_and_blocks_that_the_code_host_shows(site, path):
    shown = Article(built(site, path).read_text()).found
    markdown = MarkdownIt("commonmark").enable("table").render(path.read_text())
    expected = Article(f"<article>{markdown}</article>").found
    if path.parent.name == "api":  # the rest comes from the code
        assert shown["h3", 0] > expected["h3", 0] == 0
        return
    assert shown == expected


def test_every_link_within_the_site_leads_somewhere(site):
    """mkdocs checks those of pages; this, all: also of the API, the theme and copied files."""
    dead = []
    for page in site.rglob("*.html"):
        for link in Article(page.read_text()).links:
            if not re.match(r"[a-z]+:|#|//", link):
                target = link.split("#")[0].split("?")[0]
                base = site if target.startswith("/") else page.parent
                if not (base / target.lstrip("/")).resolve().exists():
                    dead.append((page.name, link))
    assert dead == []


def test_what_pages_link_to_outside_docs_is_in_the_site(site):
    assert (site / "examples" / "submit.py").read_text() == (
        ROOT / "examples/submit.py"
    ).read_text()
    assert "Unreleased" in (site / "CHANGELOG.html").read_text()
    assert not (site / "theme" / "links.py").exists()


WRONG = {
    "tutorial.md": "\n[gone](gone.md), [gone](../gone.md), [no such part](scores.md#no-part)\n",
    "orphan.md": "# In no menu\n",
}
TOLD = ("'gone.md'", "'../gone.md'", "'#no-part'", "- orphan.md")


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        (WRONG, TOLD),
        ({"api/rooms.md": "\n::: scenegen.open_nothing\n"}, ("scenegen.open_nothing",)),
    ],
    ids=["links and menu", "a name that is gone"],
)
def test_what_is_wrong_ends_the_build(tmp_path, texts, told):
    pytest.importorskip("mkdocs")
    sites.copied(tmp_path)
    for name, text in texts.items():
        with (tmp_path / "docs" / name).open("a") as file:
            file.write(text)
    done = sites.build(tmp_path, tmp_path / "site")
    assert done.returncode != 0
    assert [words for words in told if words not in done.stderr] == [], done.stderr


@pytest.fixture(scope="module")
def address(site):
    """Return where the site is served."""
    with sites.served(site) as found:
        yield found


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 360)])
@pytest.mark.parametrize("page", ["index", "tutorial", "your-model", "api/rooms", "results"])
def test_pages_are_for_everyone(visit, address, page, scheme, width):
    """Both palettes, wide and narrow; `visit` also fails for errors and requests outside."""
    seen = visit(f"{address}/{page}.html", width=width, color_scheme=scheme)
    seen.page.wait_for_selector(".md-search[aria-label]", state="attached")
    assert seen.violations() == []
    assert seen.page.evaluate("document.documentElement.scrollWidth") == width
    paper = seen.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (paper == "rgb(255, 255, 255)") == (scheme == "light")


def test_the_search_finds_pages(visit, address):
    page = visit(f"{address}/index.html").page
    page.click(".md-search__input")
    page.keyboard.type("mirror-pair")
    # Results of the letters typed so far come first, so that the page itself is waited for. It
    # may lie below the fold of the list.
    page.wait_for_selector('.md-search-result a[href*="iqtt.html"]', state="attached")

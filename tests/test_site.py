"""The site of docs/: it builds strictly, shows what the code host shows, and asks nobody else."""

import re
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
COUNTED = ("h1", "h2", "h3", "li", "tr", "th", "td", "pre", "img")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the folder of the built site."""
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    done = sites.build(ROOT, folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


class Article(HTMLParser):
    """Counts the elements of a page's own text, and keeps what it links to."""

    def __init__(self, text):
        super().__init__()
        self.found, self.links, self.depth = dict.fromkeys(COUNTED, 0), [], 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.depth += tag == "article"
        if self.depth and tag in self.found:
            self.found[tag] += 1
        self.links += [v for k, v in attributes if k in ("href", "src") and v]

    def handle_endtag(self, tag):
        self.depth -= tag == "article"


def built(site, path):
    place = path.relative_to(ROOT).as_posix().removeprefix("docs/").replace("README", "index")
    return site / place.replace(".md", ".html")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_a_page_has_the_lists_tables_and_blocks_that_the_code_host_shows(site, path):
    shown = Article(built(site, path).read_text()).found
    markdown = MarkdownIt("commonmark").enable("table").render(path.read_text())
    expected = Article(f"<article>{markdown}</article>").found
    if path.parent.name == "api":  # the rest comes from the code
        assert shown["h2"] > expected["h2"]
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

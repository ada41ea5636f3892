"""What the site of docs/ needs to be what the code host shows: links out of docs/, and lists.

The pages of the root, and files that pages link to outside docs/, become part of the site; links
follow them there. Dead links stay as they are, and end the build.
"""

import re
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from posixpath import normpath, relpath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
FROM_ROOT = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")
LINK = re.compile(r"(?<=\]\()[^)\s#]+")
EMPTY_HEADER = re.compile("<th( [^>]*)?></th>")
FENCED = re.compile("(^```.*?^```$)", re.MULTILINE | re.DOTALL)
NESTED = re.compile("^ +(?=- )|^  (?! )", re.MULTILINE)  # what is in a list; here 4 spaces, not 2


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root, and the files outside docs/ that pages link to."""
    for name in FROM_ROOT:
        files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    for page in list(files.documentation_pages()):
        for target in map(_target(_origin(page.src_uri)), LINK.findall(page.content_string)):
            outside = not target.startswith(("docs/", "../")) and (ROOT / target).is_file()
            if outside and files.get_file_from_path(target) is None:
                files.append(File.generated(config, target, abs_src_path=str(ROOT / target)))
    return files


def on_page_markdown(markdown: str, page: Page, files: Files, **_: Any) -> str:
    """Let links lead to where the site has their files."""
    here = PurePosixPath(page.file.src_uri).parent
    target = _target(_origin(page.file.src_uri))

    def moved(link: re.Match[str]) -> str:
        place = target(link[0]).removeprefix("docs/")
        return relpath(place, here) if files.get_file_from_path(place) else link[0]

    parts = FENCED.split(markdown)
    parts[::2] = [
        NESTED.sub(lambda indent: 2 * indent[0], LINK.sub(moved, text)) for text in parts[::2]
    ]
    return "".join(parts)


def on_page_content(html: str, **_: Any) -> str:
    """Make cells of headers that name nothing plain cells."""
    return EMPTY_HEADER.sub(r"<td\1></td>", html)


def _origin(place: str) -> PurePosixPath:
    """Return where a page of the site lies in the repository."""
    return PurePosixPath(place if place in FROM_ROOT else f"docs/{place}")


def _target(page: PurePosixPath) -> Callable[[str], str]:
    """Return a function from a link on a page to the path that it names in the repository."""
    return lambda link: normpath(page.parent / link)

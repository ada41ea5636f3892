"""What a data card tells, whatever the data: the page and the Croissant file are written from it.

Texts that come from a file or from the command line are kept as they are; whoever writes them
escapes them.
"""

import datetime
import re
from dataclasses import dataclass, field
from pathlib import Path

from scenegen.common.records import check
from scenegen.common.text_table import printable
from scenegen.files.manifest import file_sha256

HDF5, PARQUET, JSON = "application/x-hdf5", "application/x-parquet", "application/json"
PAPER = """@article{rajeswar2020pix2shape,
  title = {Pix2Shape: Towards Unsupervised Learning of 3D Scenes from Images Using a View-Based Representation},
  author = {Rajeswar, Sai and Mannan, Fahim and Golemo, Florian and Parent-L{\\'e}vesque, J{\\'e}r{\\^o}me and Vazquez, David and Nowrouzezahrai, Derek and Courville, Aaron},
  journal = {International Journal of Computer Vision},
  year = {2020},
  doi = {10.1007/s11263-020-01322-1}
}"""  # noqa: E501


@dataclass(frozen=True)
class Publication:
    """What only the person who publishes the data knows.

    Attributes:
        title: a name for people.
        creators: names of those who made the data.
        date: of publication, YYYY-MM-DD.
        license: an SPDX identifier such as CC-BY-4.0, or an address that begins with https://.
        version: of the data, as 1.0.0.
        url: of the page where the data will be; empty if it is not known yet.
    """

    title: str
    creators: tuple[str, ...]
    date: str
    license: str
    version: str = "1.0.0"
    url: str = ""

    def __post_init__(self) -> None:
        check(self.title.strip() != "", "title", "an empty text", "a name")
        names = [name.strip() for name in self.creators]
        check(len(names) > 0 and all(names), "creator", names or "none", "a name")
        _check_date(self.date)
        known = re.fullmatch(r"[A-Za-z0-9.+-]{1,60}|https?://[^\s<>\"'`]+", self.license)
        expected = "an SPDX identifier such as CC-BY-4.0, or an address"
        check(known is not None, "license", repr(self.license), expected)
        right = re.fullmatch(r"\d+\.\d+\.\d+", self.version)
        check(right is not None, "data-version", repr(self.version), "three numbers, as 1.0.0")
        place = self.url == "" or re.fullmatch(r"https?://[^\s<>\"'`]+", self.url) is not None
        check(place, "url", repr(self.url), "an address that begins with https://")

    @property
    def license_address(self) -> str:
        """Where the licence can be read."""
        if self.license.startswith("http"):
            return self.license
        return f"https://spdx.org/licenses/{self.license}.html"


@dataclass(frozen=True)
class SharedFile:
    """A file that is handed on.

    Attributes:
        name: without a folder; all files lie beside the card.
        kind: media type, one of HDF5, PARQUET and JSON.
        meaning: what it holds, in a sentence of ours.
        bytes: its size.
        sha256: of the whole file, 64 hex digits.
    """

    name: str
    kind: str
    meaning: str
    bytes: int
    sha256: str


@dataclass(frozen=True)
class IndexColumn:
    """A column of the index.

    Attributes:
        kind: "Int64", "Int32", "Float64" or "Text".
        shape: of a row's value; empty for a single one, -1 for an axis of any length.
        meaning: what it is, with its unit and frame.
    """

    name: str
    kind: str
    meaning: str
    shape: tuple[int, ...] = ()


@dataclass(frozen=True)
class DataDescription:
    """All that a card tells.

    Attributes:
        publication: what the person told.
        summary: what the data is, in one paragraph of ours.
        keywords: words to find it by.
        files: those of the data, and the index.
        index: columns of the index.
        index_file: its name.
        rows: number of rows, in all files.
        facts: tables under a title each, the first row of each being its head; of texts from
            anywhere.
        commands: of each file, by its name, the command that made it; texts from anywhere.
        requests: of each file, by its name, the request as JSON.
        layout: a Markdown table of ours: data sets of the HDF5 files, with units and frames.
        responsible: paragraphs of ours, by their names in Croissant's RAI vocabulary.
        notes: more sections of ours, by their titles.
        key: names of the columns of the index that together name a row.
    """

    publication: Publication
    summary: str
    keywords: tuple[str, ...]
    files: tuple[SharedFile, ...]
    index: tuple[IndexColumn, ...]
    index_file: str
    rows: int
    facts: dict[str, list[tuple[str, ...]]]
    commands: dict[str, str]
    requests: dict[str, str]
    layout: str
    responsible: dict[str, str | list[str]]
    notes: dict[str, str] = field(default_factory=dict)
    key: tuple[str, ...] = ("file", "row")

    @property
    def identifier(self) -> str:
        """The title in letters, digits and hyphens, for names and citation keys."""
        return re.sub(r"[^a-z0-9]+", "-", self.publication.title.lower()).strip("-") or "data"

    @property
    def citation(self) -> str:
        """BibTeX of the data itself, without characters that mean something to TeX."""
        told = self.publication
        lines = {
            "title": _plain(told.title),
            "author": " and ".join(f"{{{_plain(name)}}}" for name in told.creators),
            "year": told.date[:4],
            "version": told.version,
            "howpublished": _plain(told.url),
            "note": "Made with pix2shape-bench",
        }
        inner = ",\n".join(f"  {name} = {{{text}}}" for name, text in lines.items() if text)
        return f"@misc{{{self.identifier},\n{inner}\n}}"


def _plain(text: str) -> str:
    return "".join(c for c in printable(text) if c not in "{}\\%#$&~^")


def shared_file(path: Path, kind: str, meaning: str) -> SharedFile:
    """Return what a card tells of a file, whose bytes are read once. Raises OSError."""
    return SharedFile(path.name, kind, meaning, path.stat().st_size, file_sha256(path))


def _check_date(text: str) -> None:
    try:
        right = datetime.date.fromisoformat(text).isoformat() == text
    except ValueError:
        right = False
    check(
        right,
        "date",
        repr(text),
        "a day as YYYY-MM-DD",
    )

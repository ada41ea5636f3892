"""What is published: the files, and what only the person who publishes them knows."""

import datetime
import re
from dataclasses import dataclass
from pathlib import Path

from scenegen.common.records import check
from scenegen.common.text_table import printable
from scenegen.files.content import file_sha256

ADDRESS = r"https?://[^\s<>\"'`]+"
SPDX = r"[A-Za-z0-9.+-]{1,60}"


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
        check(_is_day(self.date), "date", repr(self.date), "a day as YYYY-MM-DD")
        expected = "an SPDX identifier such as CC-BY-4.0, or an address"
        good = re.fullmatch(f"{SPDX}|{ADDRESS}", self.license) is not None
        check(good, "license", repr(self.license), expected)
        good = re.fullmatch(r"\d+\.\d+\.\d+", self.version) is not None
        check(good, "data-version", repr(self.version), "three numbers, as 1.0.0")
        good = re.fullmatch(f"({ADDRESS})?", self.url) is not None
        check(good, "url", repr(self.url), "an address that begins with https://")

    @property
    def license_address(self) -> str:
        """Where the licence can be read."""
        if self.license.startswith("http"):
            return self.license
        return f"https://spdx.org/licenses/{self.license}.html"

    @property
    def identifier(self) -> str:
        """The title in letters, digits and hyphens, for names and citation keys."""
        return re.sub(r"[^a-z0-9]+", "-", self.title.lower()).strip("-") or "data"

    @property
    def citation(self) -> str:
        """BibTeX of the data itself, without characters that mean something to TeX."""
        lines = {
            "title": _plain(self.title),
            "author": " and ".join(f"{{{_plain(name)}}}" for name in self.creators),
            "year": self.date[:4],
            "version": self.version,
            "howpublished": _plain(self.url),
            "note": "Made with pix2shape-bench",
        }
        inner = ",\n".join(f"  {name} = {{{text}}}" for name, text in lines.items() if text)
        return f"@misc{{{self.identifier},\n{inner}\n}}"


def _is_day(text: str) -> bool:
    try:
        return datetime.date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


def _plain(text: str) -> str:
    return "".join(c for c in printable(text) if c not in "{}\\%#$&~^")


@dataclass(frozen=True)
class SharedFile:
    """A file that is handed on.

    Attributes:
        name: without a folder; all files lie beside the card.
        kind: media type.
        meaning: what it holds, in a sentence of ours.
        bytes: its size.
        sha256: of the whole file, 64 hex digits.
    """

    name: str
    kind: str
    meaning: str
    bytes: int
    sha256: str


def shared_file(path: Path, meaning: str) -> SharedFile:
    """Return what a card tells of a file, whose bytes are read once. Raises OSError."""
    kinds = {".json": "application/json", ".parquet": "application/x-parquet"}
    kind = kinds.get(path.suffix, "application/x-hdf5")
    return SharedFile(path.name, kind, meaning, path.stat().st_size, file_sha256(path))

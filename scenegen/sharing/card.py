"""Write a data card: the page of a data set, with the header that Hugging Face reads.

Texts from files and from the command line stay what they are on the page: in tables every sign that
means something to Markdown or HTML is escaped, and what is to be copied is a block of lines with
four spaces before them, in which nothing means anything.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenegen.common.records import check
from scenegen.common.text_table import markdown, piped, printable
from scenegen.files.content import file_sha256
from scenegen.files.new_file import write_text
from scenegen.files.rows import RowFile
from scenegen.files.sets.shards import OpenFile
from scenegen.sharing.export import export_stem

TEMPLATES = Path(__file__).parent / "templates"
ADDRESS = r"https?://[^\s<>\"'`]+"
SPDX = r"[A-Za-z0-9.+-]{1,60}"
HUGGING_FACE_LICENSES = (
    "apache-2.0", "cc-by-4.0", "cc-by-nc-4.0", "cc-by-nc-nd-4.0", "cc-by-nc-sa-4.0", "cc-by-nd-4.0",
    "cc-by-sa-4.0", "cc0-1.0", "mit", "odbl", "odc-by", "pddl",
)  # fmt: skip


@dataclass(frozen=True)
class Publication:
    """What only the person who publishes the data knows.

    Attributes:
        title: a name for people.
        creators: names of those who made the data.
        license: an SPDX identifier such as CC-BY-4.0, or an address that begins with https://.
    """

    title: str
    creators: Sequence[str]
    license: str

    def __post_init__(self) -> None:
        check(self.title.strip() != "", "title", "an empty text", "a name")
        names = [name.strip() for name in self.creators]
        check(len(names) > 0 and all(names), "creator", names or "none", "a name")
        expected = "an SPDX identifier such as CC-BY-4.0, or an address"
        good = re.fullmatch(f"{SPDX}|{ADDRESS}", self.license) is not None
        check(good, "license", repr(self.license), expected)

    @property
    def license_address(self) -> str:
        """Where the licence can be read."""
        if self.license.startswith("http"):
            return self.license
        return f"https://spdx.org/licenses/{self.license}.html"


def write_card(
    path: str | Path,
    publication: Publication,
    template: Path,
    shown: Sequence[RowFile],
    files: Sequence[tuple[Path, str]],
    overwrite: bool = False,
    *,
    answers: Sequence[RowFile] = (),
    keywords: Sequence[str],
    facts: Sequence[Mapping[str, str]],
    columns: str,
    **told: Any,
) -> None:
    """Write the card of open files as a Markdown file; the same files give the same bytes.

    Args:
        template: of the sections that only this kind of data has; it takes what `told` holds.
        shown: tables that may be exported to Parquet, which the header names.
        answers: further files whose requests and commands are told.
        files: those that are handed on, all in one folder, and what each holds in words of ours.
            Their bytes are read once, for the SHA-256.
        keywords: words to find the data by.
        facts: what is told of each table that is shown, by title.
        columns: the columns of the HDF5 files, as a table in Markdown.

    Raises OSError as `write_text`, and SpecError where two files have one name.
    """
    from huggingface_hub import DatasetCard, DatasetCardData

    names = [file.name for file, _ in files]
    for name in names:
        expected = "different names, because all files are next to the card"
        check(names.count(name) == 1, "files", f"{name} twice", expected)
    license_, address = publication.license, publication.license_address
    listed = license_.lower() in HUGGING_FACE_LICENSES
    header = DatasetCardData(
        pretty_name=printable(publication.title),
        license=license_.lower() if listed else "other",
        tags=list(keywords),
        configs=_configs([export_stem(file) for file in shown]),
        **({} if listed else {"license_name": license_, "license_link": address}),
    )
    texts = {_cell(file.path.name): file.attributes for file in (*shown, *answers)}
    card = DatasetCard.from_template(
        header,
        template_path=str(TEMPLATES / "card.md"),
        title=_cell(publication.title),
        about=_rendered(template, told),
        facts="\n".join(piped([list(facts[0]), *([_cell(v) for v in f.values()] for f in facts)])),
        files=[_described(*file) for file in files],
        commands=_blocks(texts, "creation_command"),
        requests=_blocks(texts, "spec"),
        columns=columns,
        license=markdown(license_),
        license_address=address,
        identifier=re.sub(r"[^a-z0-9]+", "-", publication.title.lower()).strip("-") or "data",
        plain_title=_plain(publication.title),
        authors=" and ".join(f"{{{_plain(name)}}}" for name in publication.creators),
    )
    write_text(path, str(card).rstrip() + "\n", overwrite)


def with_shards(opened: OpenFile, meaning: str) -> list[tuple[Path, str]]:
    """Return a file and, if it shows shards as one, these, and what each of them holds."""
    path = opened.path
    if not opened.shards:
        return [(path, meaning)]
    shards = [(opened.folder / shard.file, f"shard of {path.name}") for shard in opened.shards]
    return [(path, f"{meaning}; reads its shards as one file"), *shards]


def _configs(stems: Sequence[str]) -> list[dict[str, str]]:
    """Return where `datasets` finds the Parquet files of tables; it would take HDF5 files else.

    Each table has a name of its own, as tables of questions differ in columns.
    """
    names = stems if len(stems) > 1 else ["default"]
    return [
        {"config_name": name, "data_files": f"{stem}-?????-of-?????.parquet"}
        for name, stem in zip(names, stems, strict=True)
    ]


def _rendered(template: Path, told: Mapping[str, Any]) -> str:
    from jinja2 import StrictUndefined, Template

    text = template.read_text(encoding="utf-8")
    return str(Template(text, undefined=StrictUndefined).render(told)).strip()


def _described(path: Path, meaning: str) -> dict[str, Any]:
    """Return what a card tells of a file, whose bytes are read once. Raises OSError."""
    size, sha256 = path.stat().st_size, file_sha256(path)
    return {"name": _cell(path.name), "bytes": size, "sha256": sha256, "meaning": _cell(meaning)}


def _blocks(texts: Mapping[str, Mapping[str, str]], name: str) -> dict[str, str]:
    """Return an attribute of each file that has it as one line that means nothing to Markdown."""
    return {file: printable(told[name]) for file, told in texts.items() if name in told}


def _cell(text: str) -> str:
    return markdown(printable(text))


def _plain(text: str) -> str:
    """Return a text without characters that mean something to TeX."""
    return "".join(c for c in printable(text) if c not in "{}\\%#$&~^")

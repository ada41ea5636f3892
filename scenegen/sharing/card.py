"""A data card: a page in Markdown for people, Croissant for programs, and the index, in one folder.

Texts from files and from the command line stay what they are on the page: in tables every sign that
means something to Markdown or HTML is escaped, and what is to be copied is a block of lines with
four spaces before them, in which nothing means anything.
"""

import datetime
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenegen.common.records import check
from scenegen.common.text_table import markdown, piped, printable
from scenegen.files.new_file import folder_written_beside
from scenegen.files.schema import Column
from scenegen.files.sets.manifest import file_sha256
from scenegen.rendering.backend import VERSION_ATTRIBUTES

CARD, CROISSANT, INDEX = "README.md", "croissant.json", "index.parquet"
NAMES = (CARD, CROISSANT, INDEX)
HDF5, PARQUET, JSON = "application/x-hdf5", "application/x-parquet", "application/json"
ADDRESS = r"https?://[^\s<>\"'`]+"
SPDX = r"[A-Za-z0-9.+-]{1,60}"
PAPER = """@article{rajeswar2020pix2shape,
  title = {Pix2Shape: Towards Unsupervised Learning of 3D Scenes from Images Using a View-Based Representation},
  author = {Rajeswar, Sai and Mannan, Fahim and Golemo, Florian and Parent-L{\\'e}vesque, J{\\'e}r{\\^o}me and Vazquez, David and Nowrouzezahrai, Derek and Courville, Aaron},
  journal = {International Journal of Computer Vision},
  year = {2020},
  doi = {10.1007/s11263-020-01322-1}
}"""  # noqa: E501
HUGGING_FACE_LICENSES = (
    "apache-2.0", "cc-by-4.0", "cc-by-nc-4.0", "cc-by-nc-nd-4.0", "cc-by-nc-sa-4.0", "cc-by-nd-4.0",
    "cc-by-sa-4.0", "cc0-1.0", "mit", "odbl", "odc-by", "pddl",
)  # fmt: skip
SIZES = ((1e3, "n<1K"), (1e4, "1K<n<10K"), (1e5, "10K<n<100K"), (1e6, "100K<n<1M"))
RESPONSIBLE = {  # titles of sections, by the fields of mlcroissant's RAI vocabulary
    "data_use_cases": "Intended use",
    "data_limitations": "Limits",
    "data_biases": "Known biases",
    "data_collection": "How the data came about",
    "data_collection_missing_data": "Missing values",
    "data_annotation_protocol": "Labels",
    "personal_sensitive_information": "Personal data",
    "data_social_impact": "Impact on society",
    "data_release_maintenance_plan": "Maintenance",
}
# Paragraphs on all data that this program makes, by the same names.
ALL_DATA: dict[str, str | list[str]] = {
    "data_collection_type": ["Software Collection"],
    "data_social_impact": "None is expected: the images show no people, and nothing that exists.",
    "data_release_maintenance_plan": "A file is not changed after it is published; a correction"
    " gets a new version and new SHA-256s.",
}


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


def shared_file(path: Path, kind: str, meaning: str) -> SharedFile:
    """Return what a card tells of a file, whose bytes are read once. Raises OSError."""
    return SharedFile(path.name, kind, meaning, path.stat().st_size, file_sha256(path))


def tool(texts: Mapping[str, str]) -> str:
    """Return which program rendered a file, with the versions that its root names."""
    versions = ", ".join(
        f"{name.removesuffix('_version')} {texts[name]}" for name in VERSION_ATTRIBUTES
    )
    return printable(f"{texts['writer']}, {versions}, {texts['variant']}")


@dataclass(frozen=True)
class DataDescription:
    """What a card tells of the data, besides the publication and the index.

    Attributes:
        summary: what the data is, in one paragraph of ours.
        keywords: words to find it by.
        files: those of the data.
        columns: of the index.
        key: names of those columns that together name a row.
        rows: number of rows, in all files.
        facts: tables under a title each, the first row of each being its head; of texts from
            anywhere.
        commands: of each file, by its name, the command that made it; texts from anywhere.
        requests: of each file, by its name, the request as JSON.
        layout: a Markdown table of ours: data sets of the HDF5 files, with units and frames.
        responsible: paragraphs of ours, by mlcroissant's names of the fields of RAI, besides
            ALL_DATA.
        notes: more sections of ours, by their titles.
    """

    summary: str
    keywords: Sequence[str]
    files: Sequence[SharedFile]
    columns: Sequence[Column]
    key: Sequence[str]
    rows: int
    facts: Mapping[str, Sequence[tuple[str, ...]]]
    commands: Mapping[str, str]
    requests: Mapping[str, str]
    layout: str
    responsible: Mapping[str, str | list[str]]
    notes: Mapping[str, str]


def write_card(
    folder: str | Path,
    publication: Publication,
    describe: Callable[[Path], DataDescription],
    overwrite: bool = False,
) -> list[Path]:
    """Write a data card to a folder that appears complete; return its files.

    Args:
        describe: writes the index to a path and returns what is to be told of the data.

    Raises OSError as `folder_written_beside`, and whatever `describe` raises.
    """
    from scenegen.sharing.croissant import croissant_json

    with folder_written_beside(folder, NAMES, overwrite) as made:
        data = describe(made / INDEX)
        index = shared_file(made / INDEX, PARQUET, "a line for each row, without pixels")
        files = [*data.files, index]
        page, metadata = (write(publication, data, files) for write in (card_page, croissant_json))
        (made / CARD).write_text(page, encoding="utf-8")
        (made / CROISSANT).write_text(metadata, encoding="utf-8")
    return [Path(folder) / name for name in NAMES]


def card_page(publication: Publication, data: DataDescription, files: Sequence[SharedFile]) -> str:
    """Return the page of a data set, with the header that Hugging Face reads."""
    address = publication.license_address
    license_line = (
        f"The data: {markdown(publication.license)}, <{address}>. The program that made it:"
        " Apache-2.0, which says nothing about the data."
    )
    responsible = {**data.responsible, **ALL_DATA}
    checksums = [("file", "bytes", "SHA-256", "holds")]
    checksums += [(file.name, str(file.bytes), file.sha256, file.meaning) for file in files]
    citation = "The data, and the paper whose setting it follows:"
    sections: dict[str, Sequence[str]] = {
        **{title: _table(rows) for title, rows in data.facts.items()},
        "Commands": _blocks(data.commands),
        "Requests": _blocks(data.requests),
        "Data sets of the files": (data.layout,),
        "Columns of the index": _index_lines(data.columns),
        **{title: (text,) for title, text in data.notes.items()},
        **{RESPONSIBLE[name]: _paragraphs(text) for name, text in responsible.items()
           if name in RESPONSIBLE},
        "Licence": (license_line,),
        "Citation": (citation, *_block(publication.citation), *_block(PAPER)),
        "Checksums": _table(checksums),
    }  # fmt: skip
    title = markdown(printable(publication.title))
    lines = [_header(publication, data), f"# {title}", "", data.summary, ""]
    for title, text in sections.items():
        if text:
            lines += [f"## {title}", "", *text, ""]
    return "\n".join(lines).rstrip() + "\n"


def _header(publication: Publication, data: DataDescription) -> str:
    """Return the YAML that Hugging Face reads."""
    from huggingface_hub import DatasetCardData

    short = publication.license.lower()
    listed = short in HUGGING_FACE_LICENSES
    header = DatasetCardData(
        pretty_name=printable(publication.title),
        license=short if listed else "other",
        license_name=None if listed else publication.license,
        license_link=None if listed else publication.license_address,
        size_categories=[next((name for n, name in SIZES if data.rows < n), "n>1M")],
        tags=list(data.keywords),
        configs=[{"config_name": "index", "data_files": INDEX}],
    )
    return f"---\n{header.to_yaml()}\n---\n"


def _table(rows: Sequence[tuple[str, ...]]) -> list[str]:
    return piped([[markdown(printable(cell)) for cell in row] for row in rows])


def _block(text: str) -> list[str]:
    """Return text as a block that is shown as it is; control characters become escapes."""
    return ["", *(f"    {printable(line)}" for line in text.split("\n")), ""]


def _blocks(texts: Mapping[str, str]) -> list[str]:
    """Return a block of one line for each file, under the file's name."""
    lines: list[str] = []
    for name, text in texts.items():
        lines += [f"{markdown(printable(name))}:", *_block(text.replace("\n", "\\n"))]
    return lines


def _paragraphs(text: str | list[str]) -> list[str]:
    return [text] if isinstance(text, str) else [f"- {part}" for part in text]


def _index_lines(columns: Sequence[Column]) -> list[str]:
    rows = [("column", "type", "shape", "meaning")]
    for column in columns:
        shape = "(" + ", ".join("n" if n < 0 else str(n) for n in column.shape) + ")"
        rows.append((column.name, column.dtype, shape if column.shape else "", column.meaning))
    text = f"`{INDEX}` has a line for each row of the files, and no pixels."
    return [text, "", *_table(rows)]

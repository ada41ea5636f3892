"""Write a data card: a page in Markdown for people, Croissant for programs, and the index.

Texts from files and from the command line stay what they are on the page: in tables every sign that
means something to Markdown or HTML is escaped, and what is to be copied is a block of lines with
four spaces before them, in which nothing means anything.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenegen.common.text_table import markdown, piped, printable
from scenegen.files.new_file import folder_written_beside
from scenegen.files.rows import RowFile
from scenegen.files.schema import Column
from scenegen.files.sets.shards import OpenFile
from scenegen.rendering.backend import VERSION_ATTRIBUTES
from scenegen.sharing.index import INDEX, counts_table, index_columns, write_index
from scenegen.sharing.publication import Publication, shared_file
from scenegen.sharing.task import ALL_DATA, Tally, Task

CARD, CROISSANT = "README.md", "croissant.json"
NAMES = (CARD, CROISSANT, INDEX)
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


def write_card(
    folder: str | Path,
    publication: Publication,
    task: Task,
    tables: Sequence[RowFile],
    files: Sequence[tuple[Path, str]],
    notes: Callable[[Sequence[Tally]], Mapping[str, str]],
    *,
    answers: Sequence[RowFile] = (),
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write the data card of open tables to a folder that appears complete; return its files.

    The same files and the same publication give the same bytes with the same versions of pyarrow,
    `datasets` and mlcroissant. All values are read once, for the digests in the index, and all
    bytes of the files, for their SHA-256.

    Args:
        folder: to make; with `overwrite`, an older card is replaced.
        publication: what only the person who publishes the data knows.
        files: those that are handed on, and what each holds in words of ours.
        notes: returns sections of the page, by their titles, from what the tables hold.
        answers: files of which requests and commands are told too.
        progress: is told the number of rows that were read since the last call.

    Raises OSError as `folder_written_beside`, and FileFormatError where a file is damaged.
    """
    from scenegen.sharing.croissant import croissant_json

    with folder_written_beside(folder, NAMES, overwrite) as made:
        tallies = write_index(made / INDEX, task, tables, progress)
        shared = [shared_file(path, meaning) for path, meaning in files]
        shared.append(shared_file(made / INDEX, "a line for each row, without pixels"))
        facts = [task.facts(file, tally) for file, tally in zip(tables, tallies, strict=True)]
        names = [f"{file.path.name} {file.part}".rstrip() for file in tables]
        told = {file.path.name: file.attributes for file in (*tables, *answers)}
        commands = {n: t["creation_command"] for n, t in told.items() if "creation_command" in t}
        checksums = [("file", "bytes", "SHA-256", "holds")]
        checksums += [(file.name, str(file.bytes), file.sha256, file.meaning) for file in shared]
        sections = {
            "Files": _table([tuple(facts[0]), *(tuple(row.values()) for row in facts)]),
            "What they hold": _table(counts_table(task, names, tallies)),
            "Commands": _blocks(commands),
            "Requests": _blocks({name: texts["spec"] for name, texts in told.items()}),
            "Data sets of the files": (task.layout(tables),),
            "Columns of the index": _index_lines(index_columns(task)),
            "Reading": (task.reading,),
            **{title: (text,) for title, text in notes(tallies).items()},
            **_responsible(task),
            **_terms(publication),
            "Checksums": _table(checksums),
        }
        page = card_page(publication, task, sum(tally.rows for tally in tallies), sections)
        (made / CARD).write_text(page, encoding="utf-8")
        tools = sorted({_tool(file.attributes) for file in tables})
        metadata = croissant_json(publication, task, shared, tools)
        (made / CROISSANT).write_text(metadata, encoding="utf-8")
    return [Path(folder) / name for name in NAMES]


def with_shards(opened: OpenFile, meaning: str, of_set: str) -> list[tuple[Path, str]]:
    """Return a file and, if it shows shards as one, these, and what each of them holds."""
    path = opened.path
    if not opened.shards:
        return [(path, meaning)]
    shards = [(opened.folder / shard.file, f"shard of {path.name}") for shard in opened.shards]
    return [(path, of_set), *shards]


def _tool(texts: Mapping[str, str]) -> str:
    """Return which program rendered a file, with the versions that its root names."""
    versions = ", ".join(
        f"{name.removesuffix('_version')} {texts[name]}" for name in VERSION_ATTRIBUTES
    )
    return printable(f"{texts['writer']}, {versions}, {texts['variant']}")


def card_page(
    publication: Publication, task: Task, rows: int, sections: Mapping[str, Sequence[str]]
) -> str:
    """Return the page of a data set: a header that Hugging Face reads, and sections by title."""
    lines = [_header(publication, task, rows), f"# {markdown(printable(publication.title))}", ""]
    lines += [task.summary, ""]
    for title, text in sections.items():
        if text:
            lines += [f"## {title}", "", *text, ""]
    return "\n".join(lines).rstrip() + "\n"


def _responsible(task: Task) -> dict[str, Sequence[str]]:
    """Return the sections on use and limits."""
    texts = {**task.responsible, **ALL_DATA}
    return {
        RESPONSIBLE[name]: [text] if isinstance(text, str) else [f"- {part}" for part in text]
        for name, text in texts.items()
        if name in RESPONSIBLE
    }


def _terms(publication: Publication) -> dict[str, Sequence[str]]:
    """Return the sections on licence and citation."""
    license_line = (
        f"The data: {markdown(publication.license)}, <{publication.license_address}>. The program"
        " that made it: Apache-2.0, which says nothing about the data."
    )
    citation = "The data, and the paper whose setting it follows:"
    return {
        "Licence": [license_line],
        "Citation": [citation, *_block(publication.citation), *_block(PAPER)],
    }


def _header(publication: Publication, task: Task, rows: int) -> str:
    """Return the YAML that Hugging Face reads."""
    from huggingface_hub import DatasetCardData

    short = publication.license.lower()
    listed = short in HUGGING_FACE_LICENSES
    header = DatasetCardData(
        pretty_name=printable(publication.title),
        license=short if listed else "other",
        license_name=None if listed else publication.license,
        license_link=None if listed else publication.license_address,
        size_categories=[next((name for n, name in SIZES if rows < n), "n>1M")],
        tags=list(task.keywords),
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


def _index_lines(columns: Sequence[Column]) -> list[str]:
    rows = [("column", "type", "shape", "meaning")]
    for column in columns:
        shape = "(" + ", ".join("n" if n < 0 else str(n) for n in column.shape) + ")"
        rows.append((column.name, column.dtype, shape if column.shape else "", column.meaning))
    text = f"`{INDEX}` has a line for each row of the files, and no pixels."
    return [text, "", *_table(rows)]

"""A data description as a page in Markdown, with the header that Hugging Face reads.

Whatever texts come from files or from the command line, they stay what they are on the page: in
tables every sign that means something to Markdown or HTML is escaped, and what is to be copied is
a block of lines with four spaces before them, in which nothing means anything.
"""

import json
from collections.abc import Sequence

from scenegen.common.text_table import markdown, piped, printable
from scenegen.sharing.description import PAPER, DataDescription

HUGGING_FACE_LICENSES = (
    "apache-2.0", "cc-by-4.0", "cc-by-nc-4.0", "cc-by-nc-nd-4.0", "cc-by-nc-sa-4.0", "cc-by-nd-4.0",
    "cc-by-sa-4.0", "cc0-1.0", "mit", "odbl", "odc-by", "pddl",
)  # fmt: skip
SIZES = ((1e3, "n<1K"), (1e4, "1K<n<10K"), (1e5, "10K<n<100K"), (1e6, "100K<n<1M"))
RESPONSIBLE = {  # titles of sections, by the fields of Croissant's RAI vocabulary
    "dataUseCases": "Intended use",
    "dataLimitations": "Limits",
    "dataBiases": "Known biases",
    "dataCollection": "How the data came about",
    "dataCollectionMissingData": "Missing values",
    "dataAnnotationProtocol": "Labels",
    "personalSensitiveInformation": "Personal data",
    "dataSocialImpact": "Impact on society",
    "dataReleaseMaintenancePlan": "Maintenance",
}


def card_markdown(told: DataDescription) -> str:
    """Return the page of a data set."""
    publication = told.publication
    sections: dict[str, Sequence[str]] = {
        **{title: _table(rows) for title, rows in told.facts.items()},
        "Commands": _per_file(told.commands),
        "Requests": _requests(told),
        "Data sets of the files": (told.layout,),
        "Columns of the index": _index_lines(told),
        **{title: (text,) for title, text in told.notes.items()},
        **{
            title: _paragraphs(told.responsible[name])
            for name, title in RESPONSIBLE.items()
            if name in told.responsible
        },
        "Licence": _license_lines(told),
        "Citation": ("The data, and the paper whose setting it follows:", *_block(told.citation),
                     *_block(PAPER)),
        "Checksums": _checksums(told),
    }  # fmt: skip
    lines = [*_header(told), f"# {markdown(printable(publication.title))}", "", told.summary, ""]
    for title, text in sections.items():
        if text:
            lines += [f"## {title}", "", *text, ""]
    return "\n".join(lines).rstrip() + "\n"


def _quoted(value: object) -> str:
    """Return JSON without pairs of surrogates, which YAML does not know."""
    return json.dumps(value, ensure_ascii=False)


def _header(told: DataDescription) -> list[str]:
    """Return the YAML that Hugging Face reads; JSON is YAML, and quotes what people wrote."""
    publication = told.publication
    short = publication.license.lower()
    known = short in HUGGING_FACE_LICENSES
    other = [f"license_name: {_quoted(publication.license)}",
             f"license_link: {_quoted(publication.license_address)}"]  # fmt: skip
    return [
        "---",
        f"pretty_name: {_quoted(printable(publication.title))}",
        f"license: {short if known else 'other'}",
        *(() if known else other),
        f"size_categories: [{next((name for n, name in SIZES if told.rows < n), 'n>1M')}]",
        f"tags: {_quoted(list(told.keywords))}",
        "configs:",
        "- config_name: index",
        f"  data_files: {_quoted(told.index_file)}",
        "---",
        "",
    ]


def _table(rows: Sequence[tuple[str, ...]]) -> list[str]:
    return piped([[markdown(printable(cell)) for cell in row] for row in rows])


def _block(text: str) -> list[str]:
    """Return text as a block that is shown as it is; control characters become escapes."""
    return ["", *(f"    {printable(line)}" for line in text.split("\n")), ""]


def _per_file(texts: dict[str, str]) -> list[str]:
    lines: list[str] = []
    for name, text in texts.items():
        lines += [f"{markdown(printable(name))}:", *_block(text.replace("\n", "\\n"))]
    return lines


def _requests(told: DataDescription) -> list[str]:
    texts = _per_file(told.requests)
    return ["All settings that decide what they show:", "", *texts] if texts else []


def _paragraphs(text: str | list[str]) -> list[str]:
    return [text] if isinstance(text, str) else [f"- {part}" for part in text]


def _index_lines(told: DataDescription) -> list[str]:
    rows = [("column", "type", "shape", "meaning")]
    for column in told.index:
        shape = "(" + ", ".join("n" if n < 0 else str(n) for n in column.shape) + ")"
        rows.append((column.name, column.kind, shape if column.shape else "", column.meaning))
    text = f"`{told.index_file}` has a line for each row of the files, and no pixels."
    return [text, "", *_table(rows)]


def _license_lines(told: DataDescription) -> list[str]:
    publication = told.publication
    name, address = markdown(publication.license), publication.license_address
    return [
        f"The data: {name}, <{address}>. The program that made it: Apache-2.0, which says nothing"
        " about the data."
    ]


def _checksums(told: DataDescription) -> list[str]:
    rows = [("file", "bytes", "SHA-256", "holds")]
    rows += [(f.name, str(f.bytes), f.sha256, f.meaning) for f in told.files]
    return _table(rows)

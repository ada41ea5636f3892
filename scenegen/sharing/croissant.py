"""A data description as Croissant 1.1, the metadata of data sets for machine learning.

Its record set is the Parquet index: Croissant has no way to read HDF5. The files of the data are
listed with their SHA-256. Croissant's vocabulary on responsible AI (RAI 1.0) says what the data is
for and what is wrong with it.
"""

import json
from typing import Any
from urllib.parse import quote

from scenegen.common.text_table import printable
from scenegen.sharing.description import DataDescription, IndexColumn, SharedFile

CONFORMS = ["http://mlcommons.org/croissant/1.1", "http://mlcommons.org/croissant/RAI/1.0"]
TERMS = (
    "arrayShape", "citeAs", "column", "containedIn", "equivalentProperty", "extract", "field",
    "fileObject", "fileProperty", "fileSet", "format", "includes", "isArray", "isLiveDataset",
    "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex", "repeated",
    "replace", "samplingRate", "separator", "source", "subField", "transform",
)  # fmt: skip
CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "sc": "https://schema.org/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "description": {"@container": "@language"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "name": {"@container": "@language"},
    **{term: f"cr:{term}" for term in TERMS},
}
RECORDS = "rows"  # @id of the record set


def croissant_json(told: DataDescription) -> str:
    """Return the Croissant file of a data set."""
    publication = told.publication
    metadata: dict[str, Any] = {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": CONFORMS,
        "name": told.identifier,
        "alternateName": printable(publication.title),
        "description": told.summary,
        "keywords": list(told.keywords),
        "license": publication.license_address,
        "creator": [{"@type": "sc:Person", "name": printable(n)} for n in publication.creators],
        "datePublished": publication.date,
        "version": publication.version,
        "citeAs": told.citation,
        "isLiveDataset": False,
        **({"url": publication.url} if publication.url else {}),
        **{f"rai:{name}": text for name, text in told.responsible.items()},
        "distribution": [_file_object(file) for file in told.files],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": RECORDS,
                "name": RECORDS,
                "description": "One record for each row of the files, without its pixels.",
                "key": [{"@id": f"{RECORDS}/{name}"} for name in told.key],
                "field": [_field(column, told.index_file) for column in told.index],
            }
        ],
    }
    return json.dumps(metadata, indent=2) + "\n"


def _file_object(file: SharedFile) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": quote(file.name),
        "name": printable(file.name),
        "description": file.meaning,
        "contentUrl": quote(file.name),
        "contentSize": f"{file.bytes} B",
        "encodingFormat": file.kind,
        "sha256": file.sha256,
    }


def _field(column: IndexColumn, file: str) -> dict[str, Any]:
    shape = ",".join(map(str, column.shape))
    return {
        "@type": "cr:Field",
        "@id": f"{RECORDS}/{column.name}",
        "name": column.name,
        "description": column.meaning,
        "dataType": "sc:Text" if column.kind == "Text" else f"cr:{column.kind}",
        **({"isArray": True, "arrayShape": shape} if shape else {}),
        "source": {"fileObject": {"@id": quote(file)}, "extract": {"column": column.name}},
    }

"""A data card as Croissant 1.1, the metadata of data sets for machine learning, by mlcroissant.

Its record set is the Parquet index, as Croissant has no way to read HDF5. The files of the data are
listed with their SHA-256. Croissant's vocabulary on responsible AI (RAI 1.0) says what the data is
for and what is wrong with it.
"""

import json
from collections.abc import Sequence
from urllib.parse import quote

import mlcroissant

from scenegen.common.text_table import printable
from scenegen.files.schema import Column
from scenegen.sharing.index import INDEX, index_columns
from scenegen.sharing.publication import Publication, SharedFile
from scenegen.sharing.task import ALL_DATA, Task

CONFORMS = ["http://mlcommons.org/croissant/1.1", "http://mlcommons.org/croissant/RAI/1.0"]
RECORDS = "rows"  # id of the record set


def croissant_json(
    publication: Publication, task: Task, files: Sequence[SharedFile], tools: Sequence[str]
) -> str:
    """Return the Croissant file of a data set, whose files these programs rendered."""
    context = mlcroissant.Context(conforms_to=CONFORMS[0])
    records = mlcroissant.RecordSet(
        ctx=context,
        id=RECORDS,
        name=RECORDS,
        description="One record for each row of the files, without its pixels.",
        key=[f"{RECORDS}/{name}" for name in task.key],
        fields=[_field(context, column) for column in index_columns(task)],
    )
    metadata = mlcroissant.Metadata(
        ctx=context,
        name=publication.identifier,
        description=task.summary,
        keywords=list(task.keywords),
        license=[publication.license_address],
        creators=[
            mlcroissant.Person(ctx=context, name=printable(name)) for name in publication.creators
        ],
        date_published=publication.date,
        version=publication.version,
        cite_as=publication.citation,
        url=publication.url or None,
        distribution=[_file_object(context, file) for file in files],
        record_sets=[records],
        **task.responsible,
        **ALL_DATA,
        machine_annotation_tools=list(tools),
    )
    record = {**metadata.to_json(), "conformsTo": CONFORMS, "isLiveDataset": False}
    return json.dumps(record, indent=2) + "\n"


def _file_object(context: mlcroissant.Context, file: SharedFile) -> mlcroissant.FileObject:
    return mlcroissant.FileObject(
        ctx=context,
        id=quote(file.name),
        name=printable(file.name),
        description=file.meaning,
        content_url=quote(file.name),
        content_size=f"{file.bytes} B",
        encoding_formats=[file.kind],
        sha256=file.sha256,
    )


def _field(context: mlcroissant.Context, column: Column) -> mlcroissant.Field:
    extract = mlcroissant.Extract(ctx=context, column=column.name)
    shape = ",".join(map(str, column.shape))
    return mlcroissant.Field(
        ctx=context,
        id=f"{RECORDS}/{column.name}",
        name=column.name,
        description=column.meaning,
        data_types=[getattr(mlcroissant.DataType, column.dtype.upper())],
        source=mlcroissant.Source(ctx=context, file_object=quote(INDEX), extract=extract),
        **({"is_array": True, "array_shape": shape} if shape else {}),
    )

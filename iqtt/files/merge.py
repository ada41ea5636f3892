"""Make one question file of a set of shards."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py

from iqtt.files.layout import (
    ROOT_TEXTS,
    answer_column,
    named,
    question_columns,
    truth_attributes,
    truth_columns,
)
from iqtt.files.reader import QuestionsFile, open_tables
from scenegen.common.errors import FileFormatError
from scenegen.files.content import CONTENT_DIGEST, SHA256, seal
from scenegen.files.row_file import new_file
from scenegen.files.table import Table, extend_together, pack_rows
from scenegen.layout import TRUTH_DIGEST

STEP = 64  # questions that are read in one go


def merge_questions(
    path: str | Path,
    out: str | Path,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> int:
    """Write the tables of a question file, or of a set of shards, to one file.

    It has the bytes that the command which made the set would have written to one file. Returns the
    number of questions; `progress` is called with the number written since the last call.

    Raises as `QuestionsFile` and `new_file`; SpecError for a released file; and FileFormatError
    where a value is not the one that was written to its shard. Nothing is then left.
    """
    tables = open_tables(path)
    with tables[0] as first:
        if first.spec is None:
            raise FileFormatError(path, "a released file", "one that iqtt make-split wrote")
        with new_file(out, overwrite) as file:
            names = [n for n in ROOT_TEXTS if n not in ("split", CONTENT_DIGEST)]
            told = {n: first.attributes[n] for n in names if n in first.attributes}
            file.attrs.update({**told, "split": first.split})
            for table in tables:
                _copy(table, file, progress)
            seal(file)
        return sum(map(len, tables))


def _copy(table: QuestionsFile, file: h5py.File, progress: Callable[[int], Any]) -> None:
    """Write one table, in the order in which `QuestionsWriter` makes data sets."""
    assert table.spec is not None
    places = []
    if table.has_truth:
        truth = file.require_group(f"truth/{table.part}")
        truth.attrs.update(truth_attributes(table.spec))
    if "questions" in table.fields:
        places.append((file.require_group(table.part or "/"), question_columns(table.spec)))
    if table.has_truth:
        places.append((truth, truth_columns(table.spec)))
    if table.has_answers:
        places.append((file.require_group(table.part or "/"), [answer_column()]))
    compression = table.compression()
    written = [Table(group, columns, len(table), compression) for group, columns in places]
    for first in range(0, len(table), STEP):
        rows = slice(first, min(first + STEP, len(table)))
        packed = []
        for one in written:
            values = {column.name: table.read(column.name, rows) for column in one.columns}
            packed.append(pack_rows(values, one.columns, compression))
        extend_together(written, packed)
        progress(rows.stop - rows.start)
    told = table.stored_digests()
    for one in written:
        for name, dataset in one.datasets.items():
            if dataset.attrs[SHA256] != told.get(name):
                found = f"values of {name} that are not those which were written"
                raise FileFormatError(table.path, found, "", "iqtt verify tells which")
    assert table.fingerprint is not None
    file.attrs[named("fingerprint", table.part)] = table.fingerprint
    if table.stored_truth_digest is not None:
        file.attrs[named(TRUTH_DIGEST, table.part)] = table.stored_truth_digest

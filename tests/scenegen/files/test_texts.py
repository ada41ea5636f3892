"""Columns of texts: as long as the longest, the same digest as ever, read back in all ways."""

import hashlib

import h5py
import numpy as np
import pytest

from scenegen.files.input_file import StoredArray
from scenegen.files.schema import Column
from scenegen.files.table import COMPRESSIONS, Table

TEXTS = ["", "a", "Größe", "x" * 3000, "日本", *(f"{i}" * (i % 7) for i in range(2000))]


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("step", [1, 700, len(TEXTS)])
def test_texts_of_any_language(compression, step, tmp_path):
    columns = [Column("t", (), "text"), Column("pair", (2,), "text"), Column("n", (), "int32")]
    with h5py.File(tmp_path / "x.h5", "w") as file:
        table = Table(file, columns, len(TEXTS), compression)
        for first in range(0, len(TEXTS), step):
            some = TEXTS[first : first + step]
            pairs = [np.array([text, "b"], object) for text in some]
            table.extend({"t": some, "pair": pairs, "n": np.arange(len(some))})
    with h5py.File(tmp_path / "x.h5") as file:
        stored = file["t"]
        assert stored.dtype.itemsize == 3000
        assert stored.asstr()[:].tolist() == TEXTS
        assert [text.decode() for text in StoredArray(stored)[0:5]] == TEXTS[:5]
        assert StoredArray(file["pair"])[3].tolist() == [b"x" * 3000, b"b"]
        rows = [hashlib.sha256(text.encode() + b"\0").digest() for text in TEXTS]
        assert stored.attrs["sha256"] == hashlib.sha256(b"".join(rows)).hexdigest()


def test_no_rows_and_empty_texts(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        Table(file, [Column("t", (), "text")], 0)
        Table(file.create_group("g"), [Column("t", (), "text")], 2).extend({"t": ["", ""]})
        assert file["t"].shape == (0,)
        assert file["g/t"].asstr()[:].tolist() == ["", ""]

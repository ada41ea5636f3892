"""Rows that are kept beside an output: taken again, refused, begun anew, and removed at the end."""

import numpy as np
import pytest

from metrics.intake.kept_rows import kept_rows
from scenegen.common.errors import SceneGenError, SpecError

ONE, OTHER = {"model": "a"}, {"model": "b"}


@pytest.fixture
def folder(tmp_path):
    """Rows 0 and 1 of a run that failed."""
    error = SceneGenError("row 2", "an error")

    def fail():
        with kept_rows(tmp_path / "p.h5", ONE, None) as rows:
            for row in range(2):
                rows.write(row, {"depth": np.full(3, row)})
            raise error

    with pytest.raises(SceneGenError):
        fail()
    assert "2 rows" in error.hint
    return tmp_path / "p.h5.rows"


def read(out, settings, keep=None):
    """The number of kept rows, and the first number of rows 0 to 2; None where one is lacking."""
    with kept_rows(out, settings, keep) as rows:
        stored = [rows.read(row) for row in range(3)]
        return rows.count, [None if row is None else int(row["depth"][0]) for row in stored]


@pytest.mark.parametrize(
    ("settings", "keep", "expected"),
    [
        (ONE, None, (2, [0, 1, None])),
        (OTHER, "resume", (2, [0, 1, None])),
        (ONE, "restart", (0, [None] * 3)),
        (OTHER, "restart", (0, [None] * 3)),
    ],
)
def test_the_next_run(settings, keep, expected, folder):
    assert read(folder.with_suffix(""), settings, keep) == expected
    assert not folder.exists()


def test_rows_of_other_settings_are_refused(folder):
    with pytest.raises(SpecError) as caught:
        read(folder.with_suffix(""), OTHER)
    assert caught.value.where == str(folder)
    assert read(folder.with_suffix(""), ONE)[0] == 2


def test_a_row_that_was_cut_off_is_lacking(folder):
    (folder / "00000001.npz").write_bytes(b"PK")
    assert read(folder.with_suffix(""), ONE)[1] == [0, None, None]


def test_nothing_is_left_where_no_row_was_done(tmp_path):
    with pytest.raises(KeyboardInterrupt), kept_rows(tmp_path / "p.h5", ONE, None):
        raise KeyboardInterrupt
    assert not list(tmp_path.glob("*.rows"))

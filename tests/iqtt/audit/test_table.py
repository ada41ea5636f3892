"""Digests: any bit of a question file that changes after it was written is found."""

import shutil
from contextlib import contextmanager

import h5py
import numpy as np
import pytest
from h5_edits import attribute, gone
from refusals import refused

from iqtt.audit.proofs.images import content
from iqtt.audit.table import content_problems, open_paths, read_table
from iqtt.files.reader import AnswersFile
from scenegen.common.errors import FileFormatError
from scenegen.files.content import column_digest, row_digest, seal

FILES = ("iqtt-train.h5", "iqtt-val.h5", "iqtt-test.h5", "iqtt-test-answers.h5")


@contextmanager
def tables_of(*paths):
    with open_paths(paths) as opened:
        yield [read_table(*named, np.zeros(0, int)) for named in opened.items()]


def judged(*paths):
    """The proof of the content of some files, alone."""
    with tables_of(*paths) as tables:
        return content(tables)


def places(path):
    """Every attribute and every dataset of a file: (name, attribute or None)."""
    with h5py.File(path) as file:
        found = [("/", key) for key in file.attrs]

        def add(name, item):
            found.extend((name, key) for key in item.attrs)
            if isinstance(item, h5py.Dataset):
                found.append((name, None))

        file.visititems(add)
    return found


def flipped(value, rng):
    """The value with one bit changed, of a character or of a number."""
    if isinstance(value, str):
        at = int(rng.integers(len(value)))
        return value[:at] + chr(ord(value[at]) ^ 1) + value[at + 1 :]
    array = np.array(value)
    if array.dtype.kind == "O":
        array[0] = flipped(array[0], rng)
        return array
    raw = array.reshape(-1).view(np.uint8)
    raw[rng.integers(raw.size)] ^= 1 << rng.integers(8)
    return array


@pytest.mark.parametrize("every", [27, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", FILES)
def test_every_changed_bit_is_found(split_folder, tmp_path, name, every):
    """Of one place in 27; the slow test changes all."""
    rng = np.random.default_rng(7)
    for one in FILES:
        shutil.copy(split_folder / one, tmp_path)
    assert judged(tmp_path / name).status == "ok"
    whole, missed = (split_folder / name).read_bytes(), []
    for where, key in places(split_folder / name)[::every]:
        with h5py.File(tmp_path / name, "r+") as file:
            if key is None:
                file[where][...] = flipped(file[where][()], rng)
            else:
                file[where].attrs[key] = flipped(file[where].attrs[key], rng)
        try:
            if judged(tmp_path / name).status != "FAIL":
                missed.append((where, key))
        except FileFormatError:
            pass
        (tmp_path / name).write_bytes(whole)
    assert missed == []


def test_nothing_may_be_added_taken_away_or_renamed(damaged):
    edits = {
        "an attribute more": attribute("note", "mine"),
        "a dataset more": lambda file: file.create_dataset("x", data=1),
        "a name more": lambda file: file.__setitem__("zz", file["questions"]),
        "no digest of a dataset": lambda file: file["answers"].attrs.__delitem__("sha256"),
        "a group renamed": lambda file: file.move("truth", "lies"),
    }
    for name, edit in edits.items():
        assert judged(damaged(edit)).status == "FAIL", name


def test_a_forger_who_seals_again_has_another_digest_of_truth(damaged):
    """That digest is what score files name."""

    def forge(file):
        file["answers"][:] = (file["answers"][:] + 1) % 3
        file["answers"].attrs["sha256"] = column_digest(map(row_digest, file["answers"][:]))
        seal(file)

    path = damaged(forge)
    with tables_of(path) as (table,):
        assert table.truth_changed
        assert len(content_problems([table])) == 1
    with AnswersFile(path) as answers:
        assert len(answers.problems()) == 1


def test_released_files_have_no_digests_and_are_not_judged(split_folder, released):
    without = released("x.h5")
    assert judged(without).status == "skipped"
    both = judged(without, split_folder / "iqtt-train.h5")
    assert both.status == "ok"
    assert without.name in both.detail


def test_new_files_must_have_their_digests(damaged):
    for name in ("content_digest", "truth_digest"):
        with refused(FileFormatError, f"attribute {name!r}", "none"):
            judged(damaged(gone(name)))

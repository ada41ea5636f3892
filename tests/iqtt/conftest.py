"""Shared fixtures: a tiny split of ours, damaged copies of its files, and files as released."""

import shutil

import h5py
import pytest
from hypothesis import settings
from perspective_splits import SETTINGS

settings.register_profile("unhurried", deadline=None)  # a busy machine is no failure
settings.load_profile("unhurried")


@pytest.fixture(scope="session")
def split_folder(tmp_path_factory):
    """Return the files of a split that no test changes: 6 + 6, 6 and 6 questions, with depth."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec

    spec = SplitSpec(
        seed=5, train=12, labeled=6, val=6, test=6, cubes=(5, 7), lights=(1, 2), height=32,
        width=32, min_cube_pixels=2, with_depth=True,
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("iqtt") / "split"
    make_split(folder, spec, command="tests")
    return folder


@pytest.fixture(scope="session")
def rooms_folder(tmp_path_factory):
    """Return the files of a split about rooms that no test changes: 2, 2 and 3 questions."""
    from iqtt.files.make import make_split
    from iqtt.perspective.specs import perspective_spec

    spec = perspective_spec("perspective", train=2, val=2, test=3, **SETTINGS, with_depth=True)
    folder = tmp_path_factory.mktemp("rooms") / "split"
    make_split(folder, spec, command="tests")
    return folder


@pytest.fixture
def damaged(split_folder, tmp_path):
    """Return a function that copies a file of the split and lets `edit` at the copy."""

    def damage(edit, name="iqtt-val.h5"):
        path = tmp_path / name
        shutil.copy(split_folder / name, path)
        with h5py.File(path, "r+") as file:
            edit(file)
        return path

    return damage


@pytest.fixture
def few_explained(monkeypatch):
    """Lay the wrong answers of two questions on the reference; all take most of an audit's time."""
    monkeypatch.setattr("iqtt.audit.audit.EXPLAINED", 2)


@pytest.fixture
def failing(split_folder, tmp_path, few_explained):
    """Let `edit` at a copy of a file of the split; return the audit's proofs that then fail.

    It is audited together with copies of others. That the content has changed is asserted here, and
    left out.
    """
    from audit_tables import audited

    def fail(edit, name="iqtt-val.h5", *others):
        folder = tmp_path / "split"
        folder.mkdir()
        for copied in (name, *others):
            shutil.copy(split_folder / copied, folder)
        with h5py.File(folder / name, "r+") as file:
            edit(file)
        found = audited([folder], probed=0)
        skipped = {proof.name for proof in found.proofs if proof.status == "skipped"}
        assert skipped <= {"disjoint splits"}
        failed = {proof.name for proof in found.proofs if proof.status == "FAIL"}
        assert found.passed == (not failed)
        return failed - {"content"} if "content" in failed else {"content did not change"}

    return fail

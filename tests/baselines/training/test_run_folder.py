"""The folder of a run: one run at a time, none over another one, each with its own data."""

from dataclasses import replace

import pytest
from refusals import refused

from baselines.resnets.card import Card, Settings
from baselines.resnets.cnn import KIND
from baselines.training.checkpoint import CHECKPOINT, WEIGHTS, new_state, save_checkpoint
from baselines.training.run_folder import alone_in, begun, check_new, earlier_state
from scenegen.common.errors import SceneGenError, SpecError

METHOD = KIND.method
CARD = Card("cnn", Settings(width=4, size=16), labels=1, fingerprint="a" * 64)


def test_a_new_run_leaves_an_old_one_alone_and_an_old_one_needs_its_checkpoint(tmp_path):
    assert earlier_state(tmp_path / "new", METHOD, resume=False) is None
    state = new_state(METHOD, CARD)
    save_checkpoint(tmp_path, state)
    with pytest.raises(FileExistsError) as error:
        earlier_state(tmp_path, METHOD, resume=False)
    assert error.value.filename == str(tmp_path)
    assert earlier_state(tmp_path, METHOD, resume=True).card == CARD
    (tmp_path / CHECKPOINT).rename(tmp_path / WEIGHTS)
    with pytest.raises(FileExistsError) as error:
        check_new(tmp_path)
    assert error.value.filename == str(tmp_path / WEIGHTS)


def test_a_run_goes_on_with_its_own_data_alone():
    state = new_state(METHOD, CARD)
    assert begun(METHOD, CARD, state, "train.h5") is state
    assert begun(METHOD, CARD, None, "train.h5").card == CARD
    with refused(SpecError, "train.h5", "b" * 12, "a" * 12):
        begun(METHOD, replace(CARD, fingerprint="b" * 64), state, "train.h5")


def test_one_run_at_a_time_and_no_empty_folders(tmp_path):
    folder = tmp_path / "a" / "b"
    with alone_in(folder), pytest.raises(SceneGenError) as error, alone_in(folder):
        pytest.fail("another run trains there")
    assert error.value.where.startswith(str(folder))
    assert not (tmp_path / "a").exists()
    with alone_in(folder):
        (folder / "file").touch()
    assert [path.name for path in folder.iterdir()] == ["file"]

"""Logs on a full disk: one error that names the folder, and no traceback of a thread."""

import errno

import pytest

from baselines.pix2shape.training.run import log_numbers, opened_logs


def test_a_full_disk_is_one_error(tmp_path, monkeypatch, capfd):
    from tensorboard.summary.writer.record_writer import RecordWriter

    def full(*_given):
        raise OSError(errno.ENOSPC, "No space left on device")

    def log():
        with opened_logs(tmp_path / "logs", 1) as logs:
            monkeypatch.setattr(RecordWriter, "write", full)
            for iteration in range(1, 1000):
                log_numbers(logs, {"reconstruction": 0.5}, iteration)

    with pytest.raises(OSError) as error:
        log()
    assert (error.value.errno, error.value.filename) == (errno.ENOSPC, str(tmp_path / "logs"))
    assert capfd.readouterr().err == ""

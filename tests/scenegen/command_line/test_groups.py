"""What all commands do with arguments and errors."""

import subprocess
import sys
import warnings

import click
import pytest
from click.testing import CliRunner

from scenegen.command_line.groups import PackageCommands, creation_command


def group_of(callback):
    group = PackageCommands("group", modules=())
    group.get_command = lambda ctx, name: click.Command(name, callback=callback)
    return group


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        MemoryError("Unable to allocate 7 EiB"),
        RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 7 bytes."),
        RuntimeError("CUDA out of memory. Tried to allocate 7 GiB."),
        RuntimeError("unable to mmap 10 bytes: Cannot allocate memory (12)"),
    ],
)
def test_too_little_memory_is_one_line(error, check_refusal):
    def fail():
        raise error

    done = CliRunner().invoke(group_of(fail), ["x"], catch_exceptions=False)
    check_refusal(done.exit_code, done.stdout, done.stderr, ("not enough memory", str(error)))


def test_an_error_and_a_warning_are_one_line_each_whatever_they_name(check_refusal):
    def fail():
        warnings.warn("of a\nfile", stacklevel=1)
        raise OSError(2, "gone\x1b[2J", "a\nb")

    with warnings.catch_warnings():
        warnings.simplefilter("default")
        done = CliRunner().invoke(group_of(fail), ["x"], catch_exceptions=False)
    assert done.stderr.splitlines() == [r"note: of a\nfile", r"Error: a\nb: gone\x1b[2J"]


@pytest.mark.parametrize("group", ["scenegen", "bench"])
def test_arguments_that_are_not_utf8_are_refused_first(tmp_path, check_refusal, group):
    command = [sys.executable, "-c", f"import cli; cli.{group}()"]
    done = subprocess.run(
        [*command, "render", "--n", "1", "--out", b"\xff.h5"],
        cwd=tmp_path,
        capture_output=True,
        check=False,
    )
    check_refusal(done.returncode, "", done.stderr.decode(), (r"\udcff.h5", "UTF-8"))
    assert list(tmp_path.iterdir()) == []


def test_an_argument_with_a_nul_is_refused(check_refusal):
    done = CliRunner().invoke(group_of(lambda: None), ["x\0"], catch_exceptions=False)
    check_refusal(done.exit_code, done.stdout, done.stderr, (r"x\x00",))


def test_a_recorded_command_can_be_pasted(monkeypatch):
    words = ["render", "--out", "my rooms.h5", "--objects-root", "it's $HOME; rm *", "--seed", "1"]
    monkeypatch.setattr(sys, "argv", ["/x/scenegen", *words])
    shell = ["sh", "-c", f"printf '%s\\n' {creation_command('scenegen')}"]
    done = subprocess.run(shell, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["scenegen", *words]

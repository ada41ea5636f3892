"""Types of options: what they read, and that everything else is refused with what was found.

And what all commands do with arguments and errors.
"""

import subprocess
import sys
import warnings

import click
import pytest
from click.testing import CliRunner

from scenegen.common.command_line import (
    MOST_ITEMS,
    Color,
    Items,
    Names,
    Numbers,
    PackageCommands,
    Range,
    Size,
    creation_command,
)

READ = [
    (Range(int), "3", (3, 3)),
    (Range(int), " 1-3 ", (1, 3)),
    (Range(float), "0.08-0.1", (0.08, 0.1)),
    (Range(float), "1e-1", (0.1, 0.1)),
    (Range(int), (1, 2), (1, 2)),
    (Size(), "24", (24, 24)),
    (Size(), "16X24", (16, 24)),
    (Items(), "3,5-6, 0", [3, 5, 6, 0]),
    (Items(), "0-99999999999", list(range(MOST_ITEMS + 1))),
    (Names(), "mug, bowl", ("mug", "bowl")),
    (Names(), "", ("",)),
    (Numbers(), "0,5, 35", (0.0, 5.0, 35.0)),
    (Numbers(), "1e999", (float("inf"),)),
    (Color(), "White", (1.0, 1.0, 1.0)),
    (Color(), "black", (0.0, 0.0, 0.0)),
    (Color(), "0.5", (0.5, 0.5, 0.5)),
    (Color(), "0.1,0.2,3", (0.1, 0.2, 3.0)),
]
REFUSED = [
    (Range(int), ["", "-1", "a-b", "1-2-3", "1.5", "1-", "nan", "9" * 5000]),
    (Range(float), ["nan", "inf", "big", "-1", "1,5"]),
    (Size(), ["", "12xx", "1x2x3", "-5", "x", "\N{SUPERSCRIPT TWO}", "9" * 5000]),
    (Items(), ["", "-1", "a", "0,", "1.5", "5-2"]),
    (Numbers(), ["", "x", "0,-5", "0,,5", "0,nan"]),
    (Color(), ["", "red", "0.5,0.5", "1,1,1,1", "nan", "-1"]),
]


@pytest.mark.parametrize(("kind", "text", "value"), READ, ids=lambda x: str(x)[:20])
def test_texts_are_read(kind, text, value):
    assert kind.convert(text, None, None) == value


@pytest.mark.parametrize(
    ("kind", "text"), [(kind, text) for kind, some in REFUSED for text in some],
    ids=lambda x: str(x)[:20] or "empty",
)  # fmt: skip
def test_other_texts_are_refused(kind, text):
    with pytest.raises(click.BadParameter) as caught:
        kind.convert(text, None, None)
    assert repr(text)[:50] in caught.value.message
    assert kind.expected in caught.value.message


def group_of(callback):
    group = PackageCommands("group", modules=())
    group.get_command = lambda ctx, name: click.Command(name, callback=callback)
    return group


@pytest.mark.parametrize("error", [MemoryError(), MemoryError("Unable to allocate 7 EiB")])
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


@pytest.mark.parametrize("batch", ["", " --batch 8", " --batch=8", " --batch 8 --batch=9"])
def test_the_batch_is_not_recorded(monkeypatch, batch):
    monkeypatch.setattr(sys, "argv", ["/x/scenegen", *f"render{batch} --n 5".split()])
    assert creation_command("scenegen") == "scenegen render --n 5"

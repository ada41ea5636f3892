"""Types of options: what they read, and that everything else is refused with what was found."""

import click
import pytest

from scenegen.command_line.options import (
    MOST_ITEMS,
    Color,
    Items,
    Names,
    Numbers,
    Range,
    Renamed,
    Size,
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
    (Names(), '"tables, round", mug', ("tables, round", "mug")),
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


@pytest.mark.parametrize(("more", "given"), [({"is_flag": True}, True), ({"type": int}, 3)])
def test_a_former_name_is_read_and_not_shown(more, given):
    option = Renamed(["--new", "chosen"], former="--old", **more)
    command = click.Command("make", params=[option])
    for name in ("--new", "--old"):
        words = [name] if more.get("is_flag") else [name, "3"]
        assert command.make_context("make", words).params["chosen"] == given
    assert "--old" not in command.get_help(click.Context(command))

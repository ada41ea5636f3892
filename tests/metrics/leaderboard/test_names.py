"""Names that could be taken for another's, or for the leaderboard's own marks."""

from pathlib import Path

import pytest
from made_scores import simple_rooms
from refusals import refused

from baselines.commands import baseline
from metrics.leaderboard.names import BASELINES, LookAlikeError, check_names, skeleton

INVISIBLE = (
    "\u200b", "\u200d", "\u00ad", "\u034f", "\ufe0f", "\U000e0061", "\U000e0100", "\u2066",
    "\u2800", "\u3164", "\u180e", "\u2060", "\x00", " ",
)  # fmt: skip
LIKE_ORACLE = (
    *("oracle" + hidden for hidden in INVISIBLE),
    *("or\u0430cle", "\u03bfracle", "\u0585racle", "\uff4fracle", "\U0001d428racle", "ora\u217dle"),
    *("orac1e", "oracIe", "orac|e"),
)


def named(*names):
    return [simple_rooms(name, path=Path(f"{i}.json")) for i, name in enumerate(names)]


@pytest.mark.parametrize("name", LIKE_ORACLE, ids=ascii)
def test_look_alikes_of_a_baseline_are_refused(name):
    with refused(LookAlikeError, "0.json", ascii(name), "'oracle' of the benchmark", "rename"):
        check_names(named(name))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("mine", "m\u0456ne"),
        ("mine", "mine "),
        ("modern", "modem"),
        ("Oslo", "0slo"),
        ("caf\u00e9", "cafe\u0301"),
        ("v2", "\uff562"),
        ("a b", "a\u00a0b"),
        ("a-b", "a\u2013b"),
    ],
)
def test_look_alikes_of_each_other_are_refused(first, second):
    check_names(named(first))
    with refused(LookAlikeError, "1.json", ascii(second), f"{first!a} of 0.json", "rename"):
        check_names(named(first, second))


def test_other_names_are_shown():
    check_names(
        named("oracle", "oracle", "Oracle", "oracles", "oracl\u00e9", "PTN", "ptn", "pix2shape")
    )
    check_names(
        named(
            "a (big)",
            "floor plans",
            "run #2 of a",
            "[x] a",
            "C#",
            "cross-entropy",
            "\u6df1\u5ea6",
            "",
        )
    )


MARKED = [
    "a \u2020",
    "\u2021",
    "a \u271d",
    "a \u01c2",
    "a \u2e38",
    "a (2 runs)",
    "a (cIaims depth when x)",
]
MARKED += ["a #2", "a \uff032", "a #\u0661", "a [b]", "a \uff3bb\uff3d"]
MARKED += ["floor: empty room", "noise floor", "fl\u043eor: x"]


@pytest.mark.parametrize("name", MARKED, ids=ascii)
def test_marks_of_the_leaderboard_are_refused(name):
    with refused(LookAlikeError, "0.json", ascii(name), "leaderboard adds", "rename"):
        check_names(named(name))


def test_all_baselines_are_known():
    (choices,) = (p.type.choices for p in baseline.params if p.name == "name")
    assert set(choices) == set(BASELINES)


def test_skeletons_have_no_look_alikes_left():
    for text in ("0rac1e\u0430", "modern\uff0d\u2013", "\u0665"):
        assert skeleton(skeleton(text)) == skeleton(text)

"""JSON to dataclasses: no value of another type, size or name gets past, at any depth."""

import json
from dataclasses import dataclass
from typing import Any

import pytest

from scenegen.common.errors import SpecError
from scenegen.common.records import (
    LARGEST,
    LONGEST_JSON,
    changed_settings,
    check,
    from_json,
    to_json,
)


@dataclass(frozen=True)
class Leaf:
    place: tuple[float, float]
    name: str = "leaf"

    def __post_init__(self) -> None:
        check(self.name != "", "name", "nothing", "a name")


@dataclass(frozen=True)
class Tree:
    count: int
    tall: bool
    height: float
    leaves: tuple[Leaf, ...]
    best_leaf: Leaf | None = None


TREE = Tree(3, True, 0.1 + 0.2, (Leaf((1.5, -2.0)), Leaf((0.0, 1e-300), "b")), Leaf((0.5, 0.5)))
RAW: dict[str, Any] = json.loads(to_json(TREE))


def test_both_ways() -> None:
    assert from_json(Tree, to_json(TREE), "tree") == TREE
    assert from_json(Tree, to_json(TREE).encode(), "tree") == TREE
    assert hash(from_json(Tree, to_json(TREE), "tree")) == hash(TREE), "tuples, not lists"
    assert from_json(Tree, json.dumps(RAW | {"best_leaf": None}), "tree").best_leaf is None
    bare = {name: RAW[name] for name in ("count", "tall", "height", "leaves")}
    assert from_json(Tree, json.dumps(bare), "tree").best_leaf is None
    whole = from_json(Tree, json.dumps(RAW | {"height": 3}), "tree").height
    assert (whole, type(whole)) == (3.0, float)
    assert to_json(TREE, sort_keys=True) == json.dumps(RAW, sort_keys=True, separators=(",", ":"))
    assert changed_settings(Leaf((1.0, 2.0), "c")) == {"place": (1.0, 2.0), "name": "c"}


@pytest.mark.parametrize(
    ("change", "where", "found", "expected"),
    [
        ({"count": 3.0}, "count", "3.0", "whole number"),
        ({"count": "3"}, "count", "'3'", "whole number"),
        ({"count": True}, "count", "True", "whole number"),
        ({"count": None}, "count", "None", "whole number"),
        ({"tall": 1}, "tall", "1", "true or false"),
        ({"height": "1"}, "height", "'1'", "number"),
        ({"height": False}, "height", "False", "number"),
        ({"height": float("nan")}, "height", "nan", "finite"),
        ({"height": float("-inf")}, "height", "-inf", "finite"),
        ({"height": 2 * LARGEST}, "height", "2000000000.0", "at most 1e+09"),
        ({"height": -2 * LARGEST}, "height", "-2000000000.0", "at most 1e+09"),
        ({"height": 10**400}, "height", "1000", "finite"),
        ({"leaves": {"place": [0, 0]}}, "leaves", "{'place'", "list"),
        ({"leaves": ["a"]}, "leaves 0", "'a'", "JSON object"),
        ({"leaves": [{"place": [1.0]}]}, "leaves 0 place", "1 values", "more values"),
        ({"leaves": [{"place": [1.0, 2.0, 3.0]}]}, "leaves 0 place", "[1.0, ", "fewer values"),
        ({"leaves": [{"place": [1.0, None]}]}, "leaves 0 place 1", "None", "number"),
        ({"leaves": [{"place": [1.0, 3 * LARGEST]}]}, "leaves 0 place 1", "3000000000.0", "1e+09"),
        ({"leaves": [{"place": "ab"}]}, "leaves 0 place", "'ab'", "list"),
        ({"leaves": [{}]}, "leaves 0 place", "nothing", "a value"),
        ({"leaves": [{"place": [1.0, 2.0], "name": 3}]}, "leaves 0 name", "3", "text"),
        ({"leaves": [{"place": [1.0, 2.0], "name": ""}]}, "name", "nothing", "a name"),
        ({"best_leaf": {"place": [1.0, 2.0], "x": 0}}, "best leaf", "an unknown field 'x'", ""),
        ({"best_leaf": False}, "best leaf", "False", "JSON object"),
        ({"weight": 1}, "tree", "an unknown field 'weight'", ""),
        ({"w" * 99: 1}, "tree", "an unknown field 'www", ""),
    ],
)
def test_what_is_off_is_named(
    change: dict[str, Any], where: str, found: str, expected: str
) -> None:
    with pytest.raises(SpecError) as caught:
        from_json(Tree, json.dumps(RAW | change), "tree")
    assert caught.value.where == where
    assert caught.value.found.startswith(found)
    assert len(caught.value.found) <= 60
    assert expected in caught.value.expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        *((text, "JSON") for text in ("", "{", "nul", b"\xff\xfe", '{"count": 1e}')),
        ("[" * 100_000, "JSON"),
        ('{"count": 1' + "0" * 9000 + "}", "JSON"),
        ("\ud800", "string"),
        *((text, "JSON object") for text in ("[]", "3", "null", '"a"')),
    ],
    ids=lambda value: str(value)[:12].encode("ascii", "replace").decode(),
)
def test_what_is_no_record_is_refused(text: str | bytes, expected: str) -> None:
    with pytest.raises(SpecError) as caught:
        from_json(Tree, text, "tree")
    assert caught.value.where == "tree"
    assert expected in caught.value.expected


def test_a_byte_order_mark_is_ignored_and_the_length_is_bounded() -> None:
    text = to_json(TREE)
    assert from_json(Tree, "\ufeff" + text, "tree") == TREE
    assert from_json(Tree, b"\xef\xbb\xbf" + text.encode(), "tree") == TREE
    assert from_json(Tree, text.ljust(LONGEST_JSON), "tree") == TREE
    with pytest.raises(SpecError) as caught:
        from_json(Tree, text.ljust(LONGEST_JSON + 1), "tree")
    assert caught.value.where == "tree"

"""JSON to dataclasses: no value of another type, size or name gets past, at any depth."""

import json
from dataclasses import dataclass
from typing import Any

import pytest

from scenegen.common.errors import SpecError
from scenegen.common.records import LARGEST, check, check_range, from_json, to_json


@dataclass(frozen=True)
class Leaf:
    place: tuple[float, float]
    name: str = "leaf"


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
    assert from_json(Tree, json.dumps(RAW | {"best_leaf": None}), "tree").best_leaf is None
    bare = {name: RAW[name] for name in ("count", "tall", "height", "leaves")}
    assert from_json(Tree, json.dumps(bare), "tree").best_leaf is None
    assert to_json(TREE, sort_keys=True) == json.dumps(RAW, sort_keys=True, separators=(",", ":"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 3.0}, "count: found 3.0, expected a whole number"),
        ({"count": "3"}, "count: found '3', expected a whole number"),
        ({"count": True}, "count: found True, expected a whole number"),
        ({"count": None}, "count: found None"),
        ({"tall": 1}, "tall: found 1, expected true or false"),
        ({"height": "1"}, "height: found '1', expected a finite number"),
        ({"height": False}, "height: found False"),
        ({"height": float("nan")}, "height: found nan"),
        ({"height": float("-inf")}, "height: found -inf"),
        ({"height": 2 * LARGEST}, "height: found 2"),
        pytest.param(
            {"height": 10**400},
            "height: found 1000",
        ),
        ({"leaves": {"place": [0, 0]}}, "leaves: found .* expected a list"),
        ({"leaves": ["a"]}, "leaves: found str, expected a JSON object"),
        ({"leaves": [{"place": [1.0]}]}, "place: found 1 values, expected 2"),
        ({"leaves": [{"place": [1.0, 2.0, 3.0]}]}, "place: found 3 values, expected 2"),
        ({"leaves": [{"place": [1.0, None]}]}, "place: found None"),
        ({"leaves": [{"place": "ab"}]}, "place: found 'ab', expected a list"),
        ({"leaves": [{}]}, "leaves: the field 'place' is missing"),
        ({"leaves": [{"place": [1.0, 2.0], "name": 3}]}, "name: found 3, expected a text"),
        ({"best_leaf": {"place": [1.0, 2.0], "x": 0}}, "best leaf: found an unknown field 'x'"),
        ({"best_leaf": False}, "best leaf: found bool, expected a JSON object"),
        ({"weight": 1}, "tree: found an unknown field 'weight'"),
    ],
)
def test_what_is_off_is_named(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError, match=f"^{words}"):
        from_json(Tree, json.dumps(RAW | change), "tree")


@pytest.mark.parametrize("name", ["count", "tall", "height", "leaves"])
def test_every_field_without_a_default_is_needed(name: str) -> None:
    raw = {key: value for key, value in RAW.items() if key != name}
    with pytest.raises(SpecError, match=f"tree: the field '{name}' is missing"):
        from_json(Tree, json.dumps(raw), "tree")


@pytest.mark.parametrize("text", ["", "{", "nul", b"\xff\xfe", "[" * 100_000, '{"count": 1e}'])
def test_what_is_no_json_is_refused(text: str | bytes) -> None:
    with pytest.raises(SpecError, match=r"^tree: cannot be read as JSON: "):
        from_json(Tree, text, "tree")


@pytest.mark.parametrize("text", ["[]", "3", "null", '"a"'])
def test_what_is_no_object_is_refused(text: str) -> None:
    with pytest.raises(SpecError, match=r"^tree: found .*, expected a JSON object"):
        from_json(Tree, text, "tree")


def test_checks_say_what_was_found_and_expected() -> None:
    check(True, "size", 3, "less than 4")
    with pytest.raises(SpecError, match=r"^size: found 5, expected less than 4$"):
        check(False, "size", 5, "less than 4")
    check_range("lights", (0, 16), 0, 16)
    for pair, shown in (((2, 1), "2-1"), ((-1, 3), "-1-3"), ((17, 17), "17"), ((1, 17), "1-17")):
        with pytest.raises(SpecError, match=f"^lights: found {shown}, expected .* within 0-16$"):
            check_range("lights", pair, 0, 16)

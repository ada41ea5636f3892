"""Frozen dataclasses as JSON, both ways, and the checks that their `__post_init__` make.

Reading is pydantic's work: every value is checked against the field's type. It is imported when
the first text is read.
"""

import json
import typing
from dataclasses import fields
from functools import cache
from typing import Any, TypeVar

from scenegen.common.errors import SpecError

T = TypeVar("T")
Vector3 = tuple[float, float, float]
LARGEST = 1e9  # no length, colour or angle is larger; keeps later arithmetic from overflowing
LONGEST_JSON = 4_000_000  # characters; a request with 4,000 class names or 64 views is far shorter
# What holds for every part of a record, by the part's type in pydantic's core schema.
_RULES: dict[str, dict[str, Any]] = {
    "dataclass": {"config": {"strict": True, "extra_fields_behavior": "forbid"}},
    "float": {"ge": -LARGEST, "le": LARGEST, "allow_inf_nan": False},
    "tuple": {"fail_fast": True},  # one wrong item of a million is enough
}
_NUMBER = f"a finite number of at most {LARGEST:g}"
_EXPECTED = {
    "bool_type": "true or false",
    "dataclass_type": "a JSON object",
    "finite_number": _NUMBER,
    "float_type": _NUMBER,
    "greater_than_equal": _NUMBER,
    "int_type": "a whole number",
    "json_invalid": "JSON",
    "less_than_equal": _NUMBER,
    "missing": "a value",
    "string_type": "a text",
    "too_long": "fewer values",
    "tuple_type": "a list",
    "unexpected_keyword_argument": "",
}


def from_json(cls: type[T], text: str | bytes, what: str, most: int = LONGEST_JSON) -> T:
    """Build a dataclass, nested ones and tuples included, from what `to_json` wrote.

    Types must be exact, but a whole number may stand for a float. Floats are finite and of at
    most `LARGEST`. The text has at most `most` characters. Errors that belong to none of the
    fields name the record `what`.

    Raises SpecError, naming the field, where the text is no JSON, where a field is missing,
    unknown or of another type, and where the dataclass itself refuses the values.
    """
    from pydantic_core import ValidationError

    # pydantic keeps an error for each unknown field, so the text is bounded, not only the fields.
    check(len(text) <= most, what, f"{len(text):,} characters", f"at most {most:,}")
    mark = "\ufeff" if isinstance(text, str) else b"\xef\xbb\xbf"
    try:
        record: T = _validator(typing.cast(Any, cls)).validate_json(text.removeprefix(mark))  # type: ignore[arg-type]
    except ValidationError as error:
        raise _spec_error(error.errors(include_url=False)[0], what) from error
    return record


def to_json(record: Any, sort_keys: bool = False) -> str:
    """Return a dataclass as one line of JSON; floats keep every bit."""
    return json.dumps(record, default=vars, separators=(",", ":"), sort_keys=sort_keys)


def changed_settings(record: Any) -> dict[str, Any]:
    """Return the fields that differ from the defaults."""
    found = {f.name: (getattr(record, f.name), f.default) for f in fields(record)}
    return {name: value for name, (value, default) in found.items() if value != default}


def normalise(record: Any) -> None:
    """Give fields Python's own types: floats where they should be, tuples for lists, 0.0 for -0.0.

    Equal records so have equal JSON. To be called by `__post_init__`.
    """
    for name, kind in typing.get_type_hints(type(record)).items():
        value = getattr(record, name)
        if kind is float:
            object.__setattr__(record, name, float(value) + 0.0)
        elif kind is int or kind is bool:
            object.__setattr__(record, name, kind(value))
        elif typing.get_origin(kind) is tuple:
            element = typing.get_args(kind)[0]
            zero = "" if element is str else element(0)
            object.__setattr__(record, name, tuple(element(v) + zero for v in value))


def check(ok: bool, name: str, found: object, expected: str) -> None:
    """Raise SpecError, saying what was found and expected, unless `ok`."""
    if not ok:
        raise SpecError(name, str(found) or "nothing", expected)


def check_range(name: str, value: tuple[float, float], low: float, high: float) -> None:
    """Raise SpecError unless `value` is a rising pair within low and high."""
    shown = f"{value[0]}" if value[0] == value[1] else f"{value[0]}-{value[1]}"
    ok = low <= value[0] <= value[1] <= high
    check(ok, name, shown, f"a number or a rising range within {low}-{high}")


@cache
def _validator(cls: Any) -> Any:
    from pydantic import TypeAdapter
    from pydantic_core import SchemaValidator

    return SchemaValidator(_with_rules(TypeAdapter(cls).core_schema))


def _with_rules(schema: Any) -> Any:
    """Return a core schema with `_RULES` added to each of its parts."""
    if isinstance(schema, list):
        return [_with_rules(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    return {k: _with_rules(v) for k, v in schema.items()} | _RULES.get(schema.get("type", ""), {})


def _spec_error(detail: Any, what: str) -> SpecError:
    """Say in plain words what pydantic tells of one error."""
    kind, context = detail["type"], detail.get("ctx", {})
    if isinstance(context.get("error"), SpecError):  # a check of the dataclass's own
        return typing.cast(SpecError, context["error"])
    places = [str(part).replace("_", " ") for part in detail["loc"]]
    found, expected = f"{detail['input']!r:.40}", _EXPECTED.get(kind, detail["msg"])
    if kind == "json_invalid":
        return SpecError(what, f"no JSON ({context['error']})", "JSON")
    if kind == "unexpected_keyword_argument":
        found = f"an unknown field {detail['loc'][-1]!r:.40}"
        places.pop()
    elif kind == "missing" and isinstance(detail["input"], list):
        found, expected = f"{len(detail['input'])} values", "more values"
        places.pop()
    elif kind == "missing":
        found = "nothing"
    return SpecError(" ".join(places) or what, found, expected)

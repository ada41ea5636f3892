"""Frozen dataclasses from JSON, every value checked against the field's type."""

import json
import types
import typing
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar

from scenegen.common.errors import SpecError

T = TypeVar("T")
LARGEST = 1e9  # no length, colour or angle is larger; keeps later arithmetic from overflowing


def from_json(cls: type[T], text: str | bytes, what: str) -> T:
    """Build a dataclass, nested ones and tuples included, from what `to_json` wrote.

    Raises SpecError, beginning with `what`, where the text is no JSON, or a field is missing,
    unknown, or of another type.
    """
    try:
        record: T = _build(cls, json.loads(text), what)
    except (ValueError, RecursionError) as error:  # UnicodeDecodeError is a ValueError
        if isinstance(error, SpecError):
            raise
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise SpecError(f"{what}: cannot be read as JSON: {reason}") from error
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


def _build(cls: Any, raw: Any, where: str) -> Any:
    check(isinstance(raw, dict), where, type(raw).__name__, "a JSON object")
    types_by_name = typing.get_type_hints(cls)
    known = {f.name for f in fields(cls)}
    needed = {f.name for f in fields(cls) if f.default is MISSING}
    for name in sorted(set(raw) - known):
        raise SpecError(f"{where}: found an unknown field {name!r}")
    for name in sorted(needed - set(raw)):
        raise SpecError(f"{where}: the field {name!r} is missing")
    return cls(
        **{
            name: _value(types_by_name[name], value, name.replace("_", " "))
            for name, value in raw.items()
        }
    )


def _value(kind: Any, raw: Any, where: str) -> Any:
    """Return a value as its type says, or raise SpecError."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return None if raw is None else _value(arguments[0], raw, where)
    if origin is tuple:
        check(isinstance(raw, list), where, f"{raw!r:.40}", "a list")
        kinds = [arguments[0]] * len(raw) if arguments[-1] is Ellipsis else list(arguments)
        check(len(raw) == len(kinds), where, f"{len(raw)} values", str(len(kinds)))
        return tuple(_value(k, v, where) for k, v in zip(kinds, raw, strict=True))
    if is_dataclass(kind):
        return _build(kind, raw, where)
    if kind is float:
        number = isinstance(raw, int | float) and not isinstance(raw, bool)
        ok = number and abs(raw) <= LARGEST  # not so for NaN
        check(ok, where, f"{raw!r:.40}", "a finite number")
        return float(raw)
    ok = type(raw) is kind
    check(
        ok, where, f"{raw!r:.40}", {int: "a whole number", str: "a text"}.get(kind, "true or false")
    )
    return raw

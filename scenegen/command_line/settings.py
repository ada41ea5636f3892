"""Options of `scenegen render`, made from the settings of a request (`description.specs`)."""

import typing
from collections.abc import Callable
from dataclasses import Field, fields
from typing import Any

import click

from scenegen.command_line.options import Color, Command, Names, Numbers, Range, together
from scenegen.common.records import Vector3
from scenegen.description.specs import DatasetSpec, InteriorSpec


def setting_options() -> Callable[[Command], Command]:
    """Return what adds an option for each setting of rooms whose metadata has a text.

    Options that are left out are None, as presets and the records have the defaults.
    """
    options = {}
    for kind in (DatasetSpec, InteriorSpec):
        types = typing.get_type_hints(kind)
        for row in fields(kind):
            if row.metadata["text"]:
                options[row.name] = _option(row, types[row.name])
    return together(*options.values())


def _option(row: "Field[Any]", kind: Any) -> Callable[[Command], Command]:
    name = f"--{row.metadata['option'] or row.name.replace('_', '-')}"
    default = row.metadata["shown"] or _shown(row, name)
    more = {"is_flag": True} if kind is bool and "/" not in name else {"type": _parsed(row, kind)}
    return click.option(
        name, row.name, default=None, help=f"{row.metadata['text']} [{default}].", **more
    )


def _parsed(row: "Field[Any]", kind: Any) -> Any:
    """Return the click type of a setting."""
    if row.metadata["choices"]:
        return click.Choice(row.metadata["choices"])
    if kind == Vector3:
        return Color()
    if typing.get_origin(kind) is not tuple:
        return kind
    number = typing.get_args(kind)[0]
    if number is str:
        return Names()
    return Range(number) if row.metadata["limits"] else Numbers()


def _shown(row: "Field[Any]", name: str) -> str:
    """Return a default as the user would type it."""
    value = row.default
    if isinstance(value, bool):
        words = name.split("/--")
        return words[-1].partition("-")[0] if len(words) > 1 else "no"
    if not isinstance(value, tuple):
        return f"{value:g}" if isinstance(value, float) else f"{value}"
    ends = [f"{part:g}" for part in dict.fromkeys(value)]
    return ("-" if row.metadata["limits"] else ",").join(ends)

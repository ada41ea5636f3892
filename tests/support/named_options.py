"""Options that a text names, and the commands that it names before them."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

import click

import cli

PROGRAMS = {name: getattr(cli, name) for name in ("scenegen", "iqtt", "bench", "pix2shape")}
OPTION = re.compile(r"(?<![\w/.-])--[a-z][a-z-]*[a-z]")
COMMAND = re.compile(rf"\b({'|'.join(PROGRAMS)}) ((?:[a-z][a-z-]* ?)+)")


def named_options(text: str) -> Iterator[tuple[str, str]]:
    """Yield each option, and what stands before it in its line."""
    for line in text.splitlines():
        for match in OPTION.finditer(line):
            yield match[0], line[: match.start()]


def command_of(command: Any, words: Sequence[Any]) -> Any:
    """Return the command that words call, which begin after the name of a group."""
    for word in words:
        if isinstance(command, click.Group) and not str(word).startswith("-"):
            following = command.get_command(click.Context(command), str(word))
            command = following or command
    return command


def command_named(text: str) -> Any:
    """Return the last command that a text names; None for none."""
    matches = list(COMMAND.finditer(text))
    return command_of(PROGRAMS[matches[-1][1]], matches[-1][2].split()) if matches else None

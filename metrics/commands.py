"""The `bench` commands: parse, one library call, print. Heavy imports happen inside them."""

import click

COMMANDS: tuple[click.Command, ...] = ()

"""The groups of commands; each package holds its own commands."""

import click

from scenegen.command_line.groups import PackageCommands

ROOMS = tuple(
    f"scenegen.commands.{name}"
    for name in ("making", "rooms", "viewing", "sharing", "checking", "meshes")
)
QUESTIONS = tuple(f"iqtt.commands.{name}" for name in ("making", "questions", "sharing", "quiz"))
SCORES = (
    *(
        f"metrics.commands.{name}"
        for name in ("submissions", "intake", "truth", "asking", "standings", "figures", "sets")
    ),
    "baselines.commands",
)


@click.group(cls=PackageCommands, modules=ROOMS)
@click.version_option(package_name="pix2shape-bench")
def scenegen() -> None:
    """Render rooms with objects, with exact depth, normals, object ids and cameras."""


@click.group(cls=PackageCommands, modules=QUESTIONS)
@click.version_option(package_name="pix2shape-bench")
def iqtt() -> None:
    """Make, check and export mental-rotation questions (3D-IQTT)."""


@click.group(cls=PackageCommands, modules=SCORES)
@click.version_option(package_name="pix2shape-bench")
def bench() -> None:
    """Evaluate models: run a model or import its predictions, then score and compare."""


@click.group(
    cls=PackageCommands,
    modules=("baselines.pix2shape.commands",),
)
@click.version_option(package_name="pix2shape-bench")
def pix2shape() -> None:
    """Train the reference model Pix2Shape, predict with it, and draw what it has learned."""

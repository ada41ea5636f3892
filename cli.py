"""The groups of commands; each package holds its own commands."""

import click

from scenegen.command_line.groups import PackageCommands

ROOMS = tuple(
    f"scenegen.commands.{name}" for name in ("making", "rooms", "viewing", "sharing", "meshes")
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
    """Make rooms with objects, rendered with exact ground truth."""


@click.group(cls=PackageCommands, modules=QUESTIONS)
@click.version_option(package_name="pix2shape-bench")
def iqtt() -> None:
    """Make 3D-IQTT mental-rotation questions that only the shapes can answer."""


@click.group(cls=PackageCommands, modules=SCORES)
@click.version_option(package_name="pix2shape-bench")
def bench() -> None:
    """Score the predictions of any model, handed in as one file."""


@click.group(
    cls=PackageCommands,
    modules=("baselines.pix2shape.commands",),
)
@click.version_option(package_name="pix2shape-bench")
def pix2shape() -> None:
    """Train the reference model, predict with it, and look at what it learned."""

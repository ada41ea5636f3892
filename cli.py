"""The commands, in three groups; each package's `commands.py` holds its own."""

import click

from scenegen.common.command_line import PackageCommands


@click.group(cls=PackageCommands, modules=("scenegen.commands.rooms", "scenegen.commands.meshes"))
@click.version_option(package_name="pix2shape-bench")
def scenegen() -> None:
    """Rooms holding objects, rendered with exact ground truth."""


@click.group(cls=PackageCommands, modules=("iqtt.commands",))
@click.version_option(package_name="pix2shape-bench")
def iqtt() -> None:
    """3D-IQTT mental-rotation questions, made so that nothing but the shapes tells the answer."""


@click.group(cls=PackageCommands, modules=("metrics.commands", "baselines.commands"))
@click.version_option(package_name="pix2shape-bench")
def bench() -> None:
    """Scores for the predictions of any model, which meets us through one file."""


@click.group(cls=PackageCommands, modules=("baselines.pix2shape.commands",))
@click.version_option(package_name="pix2shape-bench")
def pix2shape() -> None:
    """The reference model: train it, predict, and look at what it learned."""

"""The command that shows rooms in 3D, in the browser, and options of all that serve pages."""

from collections.abc import Callable
from typing import Any

import click

from scenegen.command_line.groups import EXAMPLE, needs
from scenegen.command_line.options import MESHES, Command, Items, together
from scenegen.command_line.output import print_line
from scenegen.command_line.paths import InputPath


def host_options(port: int) -> Callable[[Command], Command]:
    """Return what adds the options that say where pages are served; `port` is the default."""
    return together(
        click.option("--host", metavar="ADDRESS",
                     help="Address to listen at [default: 127.0.0.1, which only this machine"
                     " reaches; with --public all addresses of this machine]."),
        click.option("--port", type=click.IntRange(0, 65535), default=port, show_default=True,
                     help="Port to listen at; 0 takes any that is free."),
        click.option("--public", is_flag=True,
                     help="Let other machines in: everyone who reaches the address sees the pages."
                     " There is no password, and the connection is not encrypted."),
        click.option("--name", "names", multiple=True, metavar="HOST",
                     help="Another name under which browsers reach the pages; may be repeated."),
    )  # fmt: skip


OPEN = click.option(
    "--open/--no-open", "open_browser", default=False, show_default=True,
    help="Open the page in a browser.",
)  # fmt: skip


@click.command(epilog=f"{EXAMPLE}scenegen view rooms.h5 --open")
@click.argument("file", type=InputPath())
@click.option("--items", type=Items(), help="Rows to show [default: all].")
@host_options(8080)
@OPEN
@MESHES
def view(
    file: str,
    items: list[int] | None,
    port: int,
    host: str | None,
    public: bool,
    names: tuple[str, ...],
    open_browser: bool,
    **meshes: Any,
) -> None:
    """Show the scenes of a file in 3D, in the browser.

    The page has the true surfels of every view, the meshes of the objects, and cameras. It asks for
    nothing outside this machine. Ctrl-C ends it.
    """
    needs("scenegen view", ("viser",), "view")
    from scenegen.common.web_hosts import hosts_of
    from scenegen.rooms.reader import RoomsFile
    from scenegen.viewing.geometry import shapes_of
    from scenegen.viewing.page import RoomsPage, scene_rows
    from scenegen.viewing.server import serve, started

    hosts = hosts_of(host, public, names)
    with RoomsFile(file) as rooms:
        scenes = scene_rows(rooms, items)
        shape_of = shapes_of(rooms.spec, **meshes)
        with started(file, hosts, port) as server:
            RoomsPage(server, rooms, shape_of, scenes)
            serve(server, hosts, print_line, open_browser)


COMMANDS = (view,)

"""The web server of a 3D page: viser's, which here refuses other sites and opens no tunnel."""

import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from scenegen.common.web_hosts import Hosts, address_of, is_own_page, listen

if TYPE_CHECKING:
    from viser import ViserServer


@contextmanager
def started(title: str, hosts: Hosts, port: int) -> Iterator["ViserServer"]:
    """Start a server for the block; port 0 takes any free one. `title` heads the controls.

    Nothing is printed, nobody can ask it to open a tunnel to the internet, and other sites' pages
    are refused.

    Raises SpecError for an address where it cannot listen.
    """
    listen(hosts, port).close()  # viser would try other ports for ever
    import rich
    import viser

    console = rich.get_console()  # viser announces itself on it
    quiet, console.quiet = console.quiet, True
    try:
        with _refusing_others(hosts):
            server = viser.ViserServer(hosts.address, port, label=title, verbose=False)
        try:
            server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
            server.gui.configure_theme(show_logo=False, show_share_button=False)
            server.gui.main_panel.dock_right()  # beside the drawing, not over it
            server.scene.set_up_direction("+y")
            # Shadows of lights that the scene has not would mislead, and cost most of a frame.
            server.scene.configure_default_lights(cast_shadow=False)
            yield server
        finally:
            server.stop()
    finally:
        console.quiet = quiet


@contextmanager
def _refusing_others(hosts: Hosts) -> Iterator[None]:
    """Let the server that viser starts in the block check the headers Host and Origin.

    Browsers let pages of any site open a WebSocket to this machine; viser does not look at the
    Origin that they send.
    """
    from websockets.asyncio import server as sockets

    serve = sockets.serve

    def guarded(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            names, sender = request.headers.get_all("Host"), request.headers.get("Origin")
            allowed = len(names) == 1 and hosts.allow(names[0])
            if not allowed or not (sender is None or is_own_page(sender, names[0])):
                return connection.respond(403, "This address is not one of the viewer.\n")
            return process_request(connection, request)

        return serve(*arguments, process_request=answer, **options)

    sockets.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        sockets.serve = serve  # type: ignore[misc]


def serve(
    server: "ViserServer", hosts: Hosts, tell: Callable[[str], None], open_browser: bool
) -> None:
    """Tell the address in one line, open it in a browser if asked to, and wait for Ctrl-C."""
    seen = ", for all who can reach this machine" if hosts.public else ""
    with suppress(KeyboardInterrupt):  # it may come as soon as the line is read
        tell(f"{address_of(hosts, server.get_port())} (Ctrl-C ends{seen})")
        if open_browser:
            webbrowser.open(address_of(hosts, server.get_port(), "localhost"))
        threading.Event().wait()

"""The web server of a 3D page: where it listens, what it never does, and how it ends."""

import errno
import socket
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from scenegen.common.errors import SpecError
from scenegen.common.web_hosts import EVERYWHERE, HERE, Hosts, hosts_of, is_local, is_own_page

if TYPE_CHECKING:
    from viser import ViserServer


@contextmanager
def started(
    title: str, host: str, port: int, names: tuple[str, ...] = ()
) -> Iterator["ViserServer"]:
    """Start a server for the block; port 0 takes any free one. `title` heads the controls.

    Browsers may call it by its address, this machine's name where others reach it, and `names`.
    Nothing is printed, nobody can ask it to open a tunnel to the internet, and other sites' pages
    are refused.

    Raises SpecError for an address where it cannot listen.
    """
    _check_free(host, port)
    import rich
    import viser

    console = rich.get_console()  # on which viser announces itself
    quiet, console.quiet = console.quiet, True
    try:
        with _refusing_others(hosts_of(host, not is_local(host), names)):
            server = viser.ViserServer(host, port, label=title, verbose=False)
        try:
            if port not in (0, server.get_port()):  # taken meanwhile: viser goes on to the next
                raise _in_use(port)
            server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
            server.gui.configure_theme(show_logo=False, show_share_button=False)
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
    """Give the server that viser starts in the block a look at who asks, which viser has not.

    Browsers let pages of any site open a WebSocket to this machine; they tell its Origin.
    """
    from websockets.asyncio import server as sockets

    serve = sockets.serve

    def guarded(*given: Any, process_request: Any, **how: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            told, sender = request.headers.get_all("Host"), request.headers.get("Origin")
            known = len(told) == 1 and hosts.allow(told[0])
            if not known or not (sender is None or is_own_page(sender, told[0])):
                return connection.respond(403, "This address is not one of the viewer.\n")
            return process_request(connection, request)

        return serve(*given, process_request=answer, **how)

    sockets.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        sockets.serve = serve  # type: ignore[misc]


def address(server: "ViserServer", everywhere: str = HERE) -> str:
    """Return the address of the page for a browser on this machine, or on others.

    Args:
        everywhere: what to call a server that listens at all addresses.
    """
    host = server.get_host()
    host = everywhere if host in (EVERYWHERE, "::") else host
    return f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}"


def serve(
    server: "ViserServer", tell: Callable[[str], None], open_browser: bool, public: bool
) -> None:
    """Tell the address in one line, open it in a browser if asked to, and wait for Ctrl-C."""
    seen = ", for all who can reach this machine" if public else ""
    with suppress(KeyboardInterrupt):  # it may come as soon as the line is read
        told = address(server, socket.gethostname()) if public else address(server)
        tell(f"{told} (Ctrl-C ends{seen})")
        if open_browser:
            webbrowser.open(address(server))
        threading.Event().wait()


def _check_free(host: str, port: int) -> None:
    """Raise SpecError unless a server can listen there; viser would try other ports for ever."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
            probe.listen(1)
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise _in_use(port) from error
            if error.errno == errno.EACCES:
                found = f"{port}, where only the system may listen"
                raise SpecError("port", found, "1024 or more, or 0 for a free one") from error
            raise SpecError("host", f"{host!r:.100}", "an address of this machine") from error


def _in_use(port: int) -> SpecError:
    return SpecError("port", f"{port}, which is in use", "a free port, or 0 for any")

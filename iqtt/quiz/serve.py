"""The server: one process that answers over HTTP until it is told to stop."""

import asyncio
import logging
import resource
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

EXCHANGE_SECONDS = 30  # for a request and its response; who is slower is cut off
IDLE_SECONDS = 5
FAREWELL_SECONDS = 3
MOST_HEADER_BYTES = 16 * 1024
MOST_CONNECTIONS = 8192
SPARE_FILES = 64  # of those that the process may open, for other things than connections


class ImpatientProtocol(H11Protocol):
    """HTTP/1.1 that cuts off clients that take too long to send a request or read a response."""

    _end: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait."""
        super().connection_made(transport)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        if self._end is not None:
            self._end.cancel()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Begin to wait for the next request."""
        super().on_response_complete()
        self._wait()

    def _wait(self) -> None:
        if self._end is not None:
            self._end.cancel()
        self._end = self.loop.call_later(EXCHANGE_SECONDS, self.transport.abort)


class QuietServer(uvicorn.Server):
    """A server that stops at SIGINT, SIGTERM or SIGHUP, once answers under way are given."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Answer signals while the server runs; only the main thread hears any."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        loop = asyncio.get_running_loop()
        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        heard = [n for n in numbers if signal.getsignal(n) is not signal.SIG_IGN]
        before = {number: signal.getsignal(number) for number in heard}
        for number in heard:
            loop.add_signal_handler(number, self.handle_exit, number, None)
        try:
            yield
        finally:
            for number in heard:
                loop.remove_signal_handler(number)
                signal.signal(number, before[number])


def serve(app: ASGIApp, listening: socket.socket, ready: Callable[[], Any]) -> None:
    """Answer requests until a signal comes; call `ready` before the first one."""
    # The threads hand over to each other often: the default of 5 ms would be felt in every answer.
    sys.setswitchinterval(0.0005)
    server = server_of(app)
    ready()
    server.run(sockets=[listening])


def server_of(app: ASGIApp) -> QuietServer:
    """Return a server that does not run yet."""
    config = uvicorn.Config(
        app,
        http=ImpatientProtocol,
        ws="none",
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_keep_alive=IDLE_SECONDS,
        timeout_graceful_shutdown=FAREWELL_SECONDS,
        h11_max_incomplete_event_size=MOST_HEADER_BYTES,
        limit_concurrency=_connections(),
    )
    # What clients do wrong is none of the terminal's business.
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    return QuietServer(config)


def _connections() -> int:
    """Let the process open as many files as it may; return how many may be connections."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MOST_CONNECTIONS + SPARE_FILES
    if soft != resource.RLIM_INFINITY and soft < wanted:
        soft = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    limit = wanted if soft == resource.RLIM_INFINITY else min(soft, wanted)
    return max(16, limit - SPARE_FILES)

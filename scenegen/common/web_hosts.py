"""Where a server on this machine listens, and who may ask it: its names, and its own pages.

`hosts_of` decides both from the options of a command.

A page of another site, open in a browser here, can send requests to this machine. It can even make
its own name lead here (DNS rebinding), and would then be of one origin with our pages. So servers
look at the headers Host and Origin, which such a page cannot change.
"""

import errno
import ipaddress
import re
import socket
from dataclasses import dataclass
from urllib.parse import urlsplit

from scenegen.common.errors import SpecError

HERE = "127.0.0.1"
EVERYWHERE = "0.0.0.0"
LOCAL_NAMES = ("localhost",)


@dataclass(frozen=True)
class Hosts:
    """Where a server listens, and the names under which it may be asked.

    No page of another site has a number for its name, or `localhost`.

    Attributes:
        address: the server listens there.
        names: in lower case.
        public: whether other machines may ask, by any IP address; otherwise only this machine, by
            a loopback address.
    """

    address: str = HERE
    names: frozenset[str] = frozenset(LOCAL_NAMES)
    public: bool = False

    def allow(self, host: str) -> bool:
        """Return whether the header Host names this server; the port is free, as of a tunnel."""
        match = re.fullmatch(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(?::[0-9]{1,5})?", host.lower())
        if match is None:
            return False
        name = match[1].removesuffix(".")
        try:
            number = ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return name in self.names
        return self.public or number.is_loopback


def hosts_of(host: str | None, public: bool, names: tuple[str, ...] = ()) -> Hosts:
    """Return where a server listens and who may ask it, from the options of its command.

    Args:
        host: address to listen at; None means 127.0.0.1, or all addresses where `public`.
        public: whether other machines may ask.
        names: further names under which browsers reach the server.

    Raises SpecError for an address that others can reach, unless `public`.
    """
    if host is None:
        host = EVERYWHERE if public else HERE
    elif not _is_local(host) and not public:
        advice = "with --public, everyone who can reach the address sees the pages"
        raise SpecError("host", f"{host!r:.100}", "127.0.0.1, ::1 or localhost", advice)
    machine = [socket.gethostname()] if public else []
    allowed = frozenset(map(str.lower, (*LOCAL_NAMES, host, *names, *machine)))
    return Hosts(HERE if host.lower() in LOCAL_NAMES else host, allowed, public)


def _is_local(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() in LOCAL_NAMES


def listen(hosts: Hosts, port: int) -> socket.socket:
    """Return a socket that listens; port 0 takes any free one.

    Raises SpecError for an address of another machine, or a port that is taken.
    """
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            hosts.address, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        # asyncio sends small packets at once only where it is told that the protocol is TCP.
        listening = socket.socket(family, kind, protocol)
    except (OSError, UnicodeError) as error:
        raise _no_address(hosts) from error
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(place)
        listening.listen(1024)
    except OSError as error:
        listening.close()
        if error.errno == errno.EADDRINUSE:
            raise SpecError("port", f"{port}, which is in use", "a free port") from error
        if error.errno == errno.EACCES:
            found = f"{port}, which only the system may use"
            raise SpecError("port", found, "1024 or more, or 0 for a free one") from error
        raise _no_address(hosts) from error
    return listening


def _no_address(hosts: Hosts) -> SpecError:
    return SpecError("host", f"{hosts.address!r:.100}", "a name or an address of this machine")


def address_of(hosts: Hosts, port: int, machine: str = "") -> str:
    """Return the address of the first page.

    Args:
        machine: name of this machine in it, where a server listens at all addresses; by default
            the name that the network knows.
    """
    host = hosts.address
    if host in (EVERYWHERE, "::"):
        host = machine or socket.gethostname()
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/"


def is_own_page(sender: str, host: str) -> bool:
    """Return whether an Origin or Referer is a page of the server that the header Host names."""
    try:
        address = urlsplit(sender)
    except ValueError:
        return False
    return address.scheme in ("http", "https") and address.netloc.lower() == host.lower()

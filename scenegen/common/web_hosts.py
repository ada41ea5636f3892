"""Where a server on this machine listens, and who may ask it: its names, and its own pages.

A page of another site, open in a browser here, can send requests to this machine. It can even make
its own name lead here (DNS rebinding), and would then be of one origin with our pages. So servers
look at the headers Host and Origin, which such a page cannot change.
"""

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
    """The names under which a server may be asked.

    No page of another site has a number for its name, or `localhost`.

    Attributes:
        names: in lower case.
        numbers: whether any IP address will do; otherwise only those of this machine itself.
    """

    names: frozenset[str] = frozenset(LOCAL_NAMES)
    numbers: bool = False

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
        return self.numbers or number.is_loopback


def listening_host(host: str | None, public: bool) -> str:
    """Return the address to listen at: by default this machine's own, or all where `public`.

    Raises SpecError for an address that others can reach, unless `public`.
    """
    if host is None:
        return EVERYWHERE if public else HERE
    if not is_local(host) and not public:
        advice = "with --public, everyone who can reach the address sees the pages"
        raise SpecError("host", f"{host!r:.100}", "127.0.0.1, ::1 or localhost", advice)
    return HERE if host.lower() in LOCAL_NAMES else host


def hosts_of(host: str, public: bool, names: tuple[str, ...] = ()) -> Hosts:
    """Return the hosts that requests may name: where the server listens, and `names`."""
    own = {host, *names, *([socket.gethostname()] if public else [])}
    return Hosts(frozenset(map(str.lower, (*LOCAL_NAMES, *own))), numbers=public)


def is_local(host: str) -> bool:
    """Return whether only this machine reaches a server at a host."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() in LOCAL_NAMES


def is_own_page(sender: str, host: str) -> bool:
    """Return whether an Origin or Referer is a page of the server that the header Host names."""
    try:
        found = urlsplit(sender)
    except ValueError:
        return False
    return found.scheme in ("http", "https") and found.netloc.lower() == host.lower()

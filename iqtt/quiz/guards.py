"""What every request must be, and what every answer says: hosts, origins, sizes, headers."""

import asyncio
import ipaddress
import re
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import parse_qsl, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from iqtt.quiz.sessions import RefusedError

MOST_BYTES = 4096  # of a request's body; honest ones have about 100
MOST_FIELDS = 8
BODY_SECONDS = 10
FORM_TYPE = "application/x-www-form-urlencoded"
LOCAL_NAMES = ("localhost",)
POLICY = (
    "default-src 'none'; img-src 'self'; style-src 'self'; script-src 'self'; form-action 'self';"
    " base-uri 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # Without it the browser would send `Origin: null` with our own forms.
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Hosts:
    """The names under which the server may be asked.

    A page of another site can make its own name lead to this machine (DNS rebinding), and would
    then be of one origin with the quiz. It cannot do so with a number or with `localhost`.

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


class Guard:
    """ASGI middleware: refuses requests of other sites, and adds `HEADERS` to every response.

    A response may have its own `Cache-Control`.
    """

    def __init__(self, app: ASGIApp, hosts: Hosts, refuse: ASGIApp) -> None:
        """Guard an app; `refuse` answers requests whose scope has a `RefusedError`, "refused"."""
        self.app, self.hosts, self.refuse = app, hosts, refuse

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        try:
            self.check(scope["method"], Headers(scope=scope))
        except RefusedError as refused:
            scope["refused"] = refused
            await self.refuse(scope, receive, send_with_headers)
        else:
            await self.app(scope, receive, send_with_headers)

    def check(self, method: str, headers: Headers) -> None:
        """Raise RefusedError for a request to another host, or a form that another site sends."""
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self.hosts.allow(hosts[0]):
            raise RefusedError(421, "This address is not one of the quiz.")
        if method in ("GET", "HEAD"):
            return
        sender = headers.get("origin") or headers.get("referer")
        if sender is not None:
            told = _split(sender)
            if told is None or told != hosts[0].lower():
                raise RefusedError(403, "Answers are taken from the quiz's own pages only.")
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            raise RefusedError(403, "Answers are taken from the quiz's own pages only.")


def _split(address: str) -> str | None:
    """Return host and port of an http address; None of anything else."""
    try:
        found = urlsplit(address)
        return found.netloc.lower() if found.scheme in ("http", "https") else None
    except ValueError:
        return None


async def read_form(request: Request, names: tuple[str, ...]) -> Mapping[str, str]:
    """Return the fields of a small form, each of `names` once and no other.

    Raises RefusedError for a body that is too large, too slow, or anything else.
    """
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != FORM_TYPE:
        raise RefusedError(415, "Only a form of the quiz's own pages is taken.")
    body = b""
    try:
        async with asyncio.timeout(BODY_SECONDS):
            async for part in request.stream():
                body += part
                if len(body) > MOST_BYTES:
                    raise RefusedError(413, "The form is too large.")
    except TimeoutError as error:
        raise RefusedError(408, "The form did not arrive in time.") from error
    try:
        pairs = parse_qsl(
            body.decode("ascii"),
            keep_blank_values=True,
            errors="strict",
            max_num_fields=MOST_FIELDS,
        )
    except ValueError as error:
        raise RefusedError(400, "The form cannot be read.") from error
    if sorted(name for name, _ in pairs) != sorted(names):
        raise RefusedError(400, "The form is not one of the quiz's own pages.")
    return dict(pairs)

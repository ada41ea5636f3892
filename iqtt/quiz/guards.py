"""What every request must be, and what every answer says: hosts, origins, sizes, headers."""

import asyncio
from collections.abc import Mapping
from urllib.parse import parse_qsl

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from iqtt.quiz.sessions import RefusedError
from scenegen.common.web_hosts import Hosts, is_own_page

MOST_BYTES = 4096  # of a request's body; honest ones have about 100
MOST_FIELDS = 8
BODY_SECONDS = 10
FORM_TYPE = "application/x-www-form-urlencoded"
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
        if sender is not None and not is_own_page(sender, hosts[0]):
            raise RefusedError(403, "Answers are taken from the quiz's own pages only.")
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            raise RefusedError(403, "Answers are taken from the quiz's own pages only.")


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

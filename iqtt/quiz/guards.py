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
KEPT = {**HEADERS, "Cache-Control": "max-age=600"}  # of what is the same for everybody


class FixedHeaders:
    """Middleware that adds `HEADERS` to every response, `KEPT` to files under `/static/`."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                kept = scope["path"].startswith("/static/")
                MutableHeaders(scope=message).update(KEPT if kept else HEADERS)
            await send(message)

        await self.app(scope, receive, send_with_headers)


class OwnPagesOnly:
    """Middleware that raises RefusedError for other hosts, and for forms of other sites."""

    def __init__(self, app: ASGIApp, hosts: Hosts) -> None:
        self.app, self.hosts = app, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        headers = Headers(scope=scope)
        names = headers.getlist("host")
        if len(names) != 1 or not self.hosts.allow(names[0]):
            raise RefusedError(421, "This address is not one of the quiz.")
        if scope["method"] not in ("GET", "HEAD"):
            sender = headers.get("origin") or headers.get("referer")
            own = sender is None or is_own_page(sender, names[0])
            if not own or headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
                raise RefusedError(403, "Answers are taken from the quiz's own pages only.")
        await self.app(scope, receive, send)


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
        text = body.decode("ascii")
        pairs = parse_qsl(text, keep_blank_values=True, errors="strict", max_num_fields=MOST_FIELDS)
    except ValueError as error:
        raise RefusedError(400, "The form cannot be read.") from error
    if sorted(name for name, _ in pairs) != sorted(names):
        raise RefusedError(400, "The form is not one of the quiz's own pages.")
    return dict(pairs)

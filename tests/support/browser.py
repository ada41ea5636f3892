"""Chromium for tests: headless, started once a session, and kept to the address under test.

Tests take the fixture `visit`:

    seen = visit(address, width=360)
    seen.page.click("text=Start")      # a playwright.sync_api.Page
    assert seen.violations() == []     # axe-core

A page that logs an error, raises one, or asks for anything outside its address fails the test when
it ends, unless the test empties `errors` or `outside`. A test is skipped only where there is no
Chromium; with CI=true it fails.
"""

import os
import re
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-dev-shm-usage", "--disable-sync",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",  # WebGL without a GPU
    "--disable-quic", "--disable-background-networking", "--disable-component-update",
    "--disable-default-apps", "--no-default-browser-check", "--no-first-run", "--hide-scrollbars",
    "--remote-debugging-port=0",
)  # fmt: skip
# A name would leave the machine even where the request is refused later.
RESOLVES_NOTHING = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost, EXCLUDE 127.0.0.1"
START_SECONDS = 60
INSIDE = ("data", "blob", "about")  # schemes of addresses that ask nobody


@dataclass
class Seen:
    """A page, and what it did.

    Attributes:
        page: of Playwright, to click and to ask.
        errors: texts of errors that the page raised or logged.
        outside: addresses that it asked for outside the one under test; none was answered.
    """

    page: Any
    errors: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)

    def violations(self) -> list[str]:
        """Return what axe-core finds wrong with the page as it is now: rule, impact, elements."""
        from axe_playwright_python.sync_playwright import Axe

        found = Axe().run(self.page).response["violations"]
        return [
            f"{one['id']} ({one['impact']}): {node['target']} {node['html'][:120]}"
            for one in found
            for node in one["nodes"]
        ]


def find_chromium() -> str:
    """Return the path of a browser; skip the test where there is none, but fail with CI=true."""
    pytest.importorskip("playwright")
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        end = pytest.fail if os.environ.get("CI", "").lower() in ("1", "true") else pytest.skip
        end(f"no browser: none of {', '.join(NAMES)}; install Debian's chromium")
    return found


@contextmanager
def started(folder):
    """Run Chromium, which keeps its files in a new folder; give the address that controls it.

    It is a process of its own and not Playwright's, whose event loop would stay in the main thread
    for all later tests.
    """
    log = folder / "log"
    with log.open("wb") as out:
        command = [find_chromium(), *FLAGS, RESOLVES_NOTHING, f"--user-data-dir={folder}"]
        process = subprocess.Popen(
            [*command, "about:blank"], stdout=out, stderr=out, start_new_session=True
        )
    try:
        port = folder / "DevToolsActivePort"
        end = time.monotonic() + START_SECONDS
        while not (port.exists() and port.read_text().count("\n")):
            if process.poll() is not None or time.monotonic() > end:
                pytest.fail(f"Chromium did not start: {log.read_text()[-2000:]}")
            time.sleep(0.02)
        yield f"http://127.0.0.1:{port.read_text().split()[0]}"
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@contextmanager
def connected(control):
    """Connect to a Chromium for one test; give `visit`, which opens pages and keeps what they did.

    Every visit has cookies and storage of its own, except with `like`, another `Seen`.
    """
    from playwright.sync_api import sync_playwright

    kept = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.connect_over_cdp(control)

        def visit(address, width=1280, height=900, like=None, **settings):
            if like is None:
                size = {"width": width, "height": height}
                context = browser.new_context(viewport=size, service_workers="block", **settings)
                context.set_default_timeout(20_000)
            else:
                context = like.page.context
            seen = Seen(context.new_page())
            kept.append(seen)
            watch(seen, address)
            seen.page.goto(address)
            return seen

        try:
            yield visit
        finally:
            for context in browser.contexts:
                context.close()
            browser.close()
    did = [(seen.errors, seen.outside) for seen in kept if seen.errors or seen.outside]
    assert not did, f"errors of pages, and what they asked for outside: {did}"


def watch(seen, address):
    """Keep errors of a page; answer no request outside the server or the file at `address`."""
    own, page = urlsplit(address), seen.page

    def is_own(url):
        asked = urlsplit(url)
        schemes = (own.scheme, own.scheme.replace("http", "ws"))
        same = asked.scheme in schemes and asked.netloc == own.netloc
        return asked.scheme in INSIDE or (same and (own.scheme != "file" or asked.path == own.path))

    def answer(route):
        if is_own(route.request.url):
            route.continue_()
        else:
            seen.outside.append(route.request.url)
            route.abort()

    page.route("**/*", answer)
    socket = re.compile(f"^(?!wss?://{re.escape(own.netloc)}/)") if own.netloc else "**/*"
    page.route_web_socket(socket, lambda socket: seen.outside.append(socket.url))
    page.on("websocket", lambda one: is_own(one.url) or seen.outside.append(one.url))  # of workers
    page.on("pageerror", lambda error: seen.errors.append(str(error)))
    page.on("console", lambda m: seen.errors.append(m.text) if m.type == "error" else None)

"""The browser of `tests/support/browser.py` tells errors, requests and violations from none."""

import http.server
import threading

import browser
import pytest

GOOD = """<!doctype html><html lang="en"><title>Good</title><link rel="icon" href="data:,">
<main><h1>Good</h1><p style="width: 50vw">Plain.</p></main></html>"""
BAD = """<!doctype html><html><title>Bad</title><link rel="icon" href="data:,">
<img src="https://example.org/outside.png"><script>null.wrong</script></html>"""

POLICY = "default-src 'unsafe-inline'; img-src data: *"  # with it axe-core runs all the same


@pytest.fixture
def server():
    class Pages(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Security-Policy", POLICY)
            self.end_headers()
            self.wfile.write((BAD if self.path == "/bad" else GOOD).encode())

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Pages) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{made.server_port}"
        made.shutdown()
        thread.join()


def test_a_good_page(visit, server, tmp_path):
    seen = visit(f"{server}/", width=360)
    assert (seen.page.title(), seen.violations()) == ("Good", [])
    assert seen.page.locator("p").bounding_box()["width"] == 180
    (tmp_path / "page.html").write_text(GOOD)
    assert visit((tmp_path / "page.html").as_uri()).page.title() == "Good"


def test_a_bad_page(visit, server):
    seen = visit(f"{server}/bad")
    assert seen.outside == ["https://example.org/outside.png"]
    assert any("null" in error for error in seen.errors)
    assert {one.split()[0] for one in seen.violations()} >= {"html-has-lang", "image-alt"}
    seen.outside.clear()
    seen.errors.clear()


def test_what_a_page_did_fails_the_test(chromium, server):
    with pytest.raises(AssertionError, match=r"outside\.png"), browser.connected(chromium) as visit:
        visit(f"{server}/bad")


@pytest.mark.parametrize(("ci", "end"), [("true", pytest.fail), ("", pytest.skip)])
def test_without_a_browser(monkeypatch, ci, end):
    monkeypatch.setattr(browser, "NAMES", ("no-such-browser",))
    monkeypatch.setenv("CI", ci)
    with pytest.raises(end.Exception, match="no-such-browser"):
        browser.find_chromium()

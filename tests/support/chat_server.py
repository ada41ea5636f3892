"""A server of OpenAI's chat protocol that a test answers."""

import base64
import json
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from iqtt.vlm.ask import Server

KEY = "sk-secret-of-this-test"
Reply = Callable[[dict[str, Any], int], tuple[int, bytes]]


def completion(text: Any, **usage: int) -> tuple[int, bytes]:
    return choice({"message": {"content": text}}, **usage)


def choice(value: dict[str, Any], **usage: int) -> tuple[int, bytes]:
    """Return a whole choice: message, finish_reason and so on."""
    return 200, json.dumps({"choices": [value], "usage": usage}).encode()


@contextmanager
def serving(reply: Reply) -> Iterator[tuple[Server, list[dict[str, Any]]]]:
    """Serve `reply`, told the body of a request and how often it came before."""
    bodies: list[dict[str, Any]] = []
    seen: Counter[str] = Counter()
    lock = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            content = self.rfile.read(int(self.headers["Content-Length"]))
            assert self.headers["Authorization"] == f"Bearer {KEY}"
            body = json.loads(content)
            with lock:
                bodies.append(body)
                times = seen[content.decode()]
                seen[content.decode()] += 1
            status, answer = reply(body, times)
            self.send_response(status)
            self.send_header("Retry-After", "0")
            cut = status == 200 and answer.endswith(b"...")
            self.send_header("Content-Length", str(len(answer) + 100 * cut))
            self.end_headers()
            self.wfile.write(answer)

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        url = f"http://127.0.0.1:{server.server_address[1]}/v1"
        yield Server("tiny", url, KEY, timeout=1.0, tries=4, concurrency=2, pause=0.01), bodies
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def picture_of(body: dict[str, Any]) -> bytes:
    """Return the first picture of a request, as a PNG file."""
    return base64.b64decode(body["messages"][0]["content"][0]["image_url"]["url"].split(",")[1])

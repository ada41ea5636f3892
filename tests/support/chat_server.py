"""A server of OpenAI's chat protocol that a test answers."""

import base64
import json
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

KEY = "sk-secret-of-this-test"
Reply = Callable[[dict[str, Any], int], tuple[int, bytes]]


def completion(text: str, ended: str = "stop") -> tuple[int, bytes]:
    """Return a reply, of two tokens to a prompt of ten."""
    message = {"role": "assistant", "content": text}
    usage = {"prompt_tokens": 10, "completion_tokens": 2, "total_tokens": 12}
    content = {
        "id": "1", "object": "chat.completion", "created": 0, "model": "tiny", "usage": usage,
        "choices": [{"index": 0, "message": message, "finish_reason": ended}],
    }  # fmt: skip
    return 200, json.dumps(content).encode()


@contextmanager
def serving(reply: Reply) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Serve `reply`, told the body of a request and how often it came before; give the address."""
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
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/v1", bodies
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def picture_of(body: dict[str, Any]) -> bytes:
    """Return the first picture of a request, as a PNG file."""
    (message,) = body["messages"]
    (url,) = [part["image_url"]["url"] for part in message["content"] if "image_url" in part]
    return base64.b64decode(url.split(",")[1])

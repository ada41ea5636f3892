"""`scenegen view` as a user types it: one line, Ctrl-C, and mistakes."""

import re
import signal
import socket
import subprocess
import sys
import urllib.request

import pytest

pytest.importorskip("viser")

COMMAND = [sys.executable, "-c", "from cli import scenegen; scenegen()", "view"]


def test_a_page_is_served_until_ctrl_c(rooms_path, tmp_path):
    command = [*COMMAND, str(rooms_path), "--port", "0", "--items", "2-4"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        found = re.fullmatch(r"(http://127\.0\.0\.1:[0-9]+/) \(Ctrl-C ends\)\n", line)
        assert found, line
        assert urllib.request.urlopen(found[1]).status == 200
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=60) == ("", "")
        assert process.returncode == 0
    finally:
        process.kill()
        process.wait()


def test_mistakes(refuses, rooms_path, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        refuses("view", rooms_path, "--port", port, words=("--port", port, "in use"))
    refuses("view", rooms_path, "--host", "0.0.0.0", words=("--host", "--public"))
    refuses("view", rooms_path, "--items", "3,8", words=("--items", "8", "0 to 7"))
    refuses("view", rooms_path, "--objects-root", tmp_path, words=("built in",))
    (tmp_path / "no.h5").write_text("nothing")
    refuses("view", tmp_path / "no.h5", words=("no.h5",))
    refuses("view", tmp_path / "none.h5", words=("none.h5",))

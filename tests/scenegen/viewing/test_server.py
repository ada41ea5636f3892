"""The server of a page: who reaches it, what it prints, and how it ends."""

import http.client
import socket
import urllib.error
import urllib.request
from contextlib import closing

import pytest

pytest.importorskip("viser")

from scenegen.common.errors import SpecError
from scenegen.viewing.server import address, started


def test_a_page_is_served_quietly_and_ends(capfd):
    with started("x", "127.0.0.1", 0) as server:
        page = urllib.request.urlopen(address(server)).read()
        assert page.startswith(b"<!doctype html>")
        assert server.request_share_url() is None
        port = server.get_port()
        with pytest.raises(SpecError) as error, started("y", "127.0.0.1", port):
            pass
        assert (error.value.where, str(port) in error.value.found) == ("port", True)
    assert capfd.readouterr() == ("", "")
    with socket.socket() as again:
        again.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        again.bind(("127.0.0.1", port))


def test_others_are_told_this_machines_name_and_may_use_another_one():
    with started("x", "0.0.0.0", 0, ("Lab.example.org",)) as server:
        port = server.get_port()
        assert address(server) == f"http://127.0.0.1:{port}"
        assert address(server, "box") == f"http://box:{port}"
        for name, code in (("lab.example.org", 200), ("evil.example", 403)):
            request = urllib.request.Request(address(server), headers={"Host": f"{name}:{port}"})
            try:
                found = urllib.request.urlopen(request).status
            except urllib.error.HTTPError as error:
                found = error.code
            assert found == code


def test_an_address_of_another_machine():
    with pytest.raises(SpecError) as error, started("x", "192.0.2.1", 0):
        pass
    assert error.value.where == "host"


@pytest.mark.parametrize(
    ("headers", "taken"),
    [
        ({}, True),
        ({"Origin": "http://{host}"}, True),
        ({"Origin": "http://evil.example"}, False),
        ({"Origin": "null"}, False),
        ({"Origin": "http://127.0.0.1:1"}, False),  # another server of this machine
        ({"Host": "evil.example"}, False),  # a name that leads here
    ],
)
def test_pages_of_other_sites_get_neither_page_nor_socket(headers, taken):
    with started("x", "127.0.0.1", 0) as server:
        host = f"127.0.0.1:{server.get_port()}"
        headers = {name: value.format(host=host) for name, value in headers.items()}
        upgrade = {
            "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==", "Sec-WebSocket-Protocol": "viser-v1",
        }  # fmt: skip
        for asked, expected in (({}, 200), (upgrade, 101)):
            with closing(http.client.HTTPConnection(host, timeout=10)) as connection:
                connection.request("GET", "/", headers={**asked, **headers})
                assert connection.getresponse().status == (expected if taken else 403)

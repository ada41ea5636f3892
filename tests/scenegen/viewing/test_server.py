"""The server of a page: who reaches it, what it prints, and how it ends."""

import http.client
import socket
from contextlib import closing

import pytest

pytest.importorskip("viser")

from scenegen.common.errors import SpecError
from scenegen.common.web_hosts import Hosts, hosts_of
from scenegen.viewing.server import started

UPGRADE = {
    "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==", "Sec-WebSocket-Protocol": "viser-v1",
}  # fmt: skip


def status(port, headers):
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as connection:
        connection.request("GET", "/", headers=headers)
        return connection.getresponse().status


def test_a_page_is_served_quietly_and_ends(capfd):
    with started("x", Hosts(), 0) as server:
        port = server.get_port()
        assert status(port, {}) == 200
        assert server.request_share_url() is None
        with pytest.raises(SpecError) as error, started("y", Hosts(), port):
            pass
        assert error.value.where == "port"
    assert capfd.readouterr() == ("", "")
    with socket.socket() as again:
        again.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        again.bind(("127.0.0.1", port))


def test_a_public_page_has_this_machines_name_and_those_it_is_given():
    with started("x", hosts_of(None, True, ("Lab.example.org",)), 0) as server:
        names = ("lab.example.org", socket.gethostname(), "192.0.2.7", "evil.example")
        codes = [status(server.get_port(), {"Host": name}) for name in names]
    assert codes == [200, 200, 200, 403]


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
    with started("x", Hosts(), 0) as server:
        port = server.get_port()
        headers = {name: value.format(host=f"127.0.0.1:{port}") for name, value in headers.items()}
        for request, expected in (({}, 200), (UPGRADE, 101)):
            assert status(port, {**request, **headers}) == (expected if taken else 403)

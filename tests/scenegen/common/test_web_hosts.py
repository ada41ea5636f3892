"""Where a server listens; who may ask it is tested with the servers themselves."""

import pytest

from scenegen.common.errors import SpecError
from scenegen.common.web_hosts import Hosts, address_of, hosts_of, listen


@pytest.mark.parametrize(
    ("host", "public", "address"),
    [
        (None, False, "127.0.0.1"),
        ("localhost", False, "127.0.0.1"),
        ("::1", False, "::1"),
        (None, True, "0.0.0.0"),
        ("192.0.2.1", True, "192.0.2.1"),
    ],
)
def test_only_this_machine_unless_public(host, public, address):
    assert hosts_of(host, public).address == address


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.1", "::", "example.org", ""])
def test_addresses_that_others_reach_need_leave(host):
    with pytest.raises(SpecError) as error:
        hosts_of(host, False)
    assert error.value.where == "host"


@pytest.mark.parametrize("host", ["192.0.2.1", "host.invalid"])
def test_an_address_of_another_machine(host):
    with pytest.raises(SpecError) as error:
        listen(hosts_of(host, True), 0)
    assert error.value.where == "host"


def test_the_address_of_the_first_page():
    assert address_of(Hosts(), 80) == "http://127.0.0.1:80/"
    assert address_of(Hosts("::1"), 80) == "http://[::1]:80/"
    assert address_of(Hosts("0.0.0.0"), 80, "box") == "http://box:80/"

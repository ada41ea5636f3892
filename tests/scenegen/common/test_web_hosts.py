"""Where a server listens; who may ask it is tested with the servers themselves."""

import pytest

from scenegen.common.errors import SpecError
from scenegen.common.web_hosts import listening_host


def test_only_this_machine_unless_public():
    assert listening_host(None, False) == "127.0.0.1"
    assert listening_host("localhost", False) == "127.0.0.1"
    assert listening_host("::1", False) == "::1"
    assert listening_host(None, True) == "0.0.0.0"
    assert listening_host("192.0.2.1", True) == "192.0.2.1"
    for host in ("0.0.0.0", "192.0.2.1", "::", "example.org", ""):
        with pytest.raises(SpecError) as error:
            listening_host(host, False)
        assert error.value.where == "host"

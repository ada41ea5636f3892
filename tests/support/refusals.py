"""What tests ask of an error: its kind and its fields, never its sentence."""

from contextlib import contextmanager

import pytest


@contextmanager
def refused(kind, where="", found="", expected="", hint=""):
    """An error of this kind: its place ends in `where`, and its other fields hold these texts."""
    with pytest.raises(kind) as caught:
        yield
    error = caught.value
    assert error.where.endswith(where), error.where
    assert found in error.found, error.found
    assert expected in error.expected, error.expected
    assert hint in error.hint, error.hint

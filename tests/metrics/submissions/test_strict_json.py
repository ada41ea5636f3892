"""The bound of the memory that a JSON text takes, held against what Python allocates for it."""

import tracemalloc

import pytest
from refusals import refused

from metrics.submissions.problems import JsonError
from metrics.submissions.strict_json import memory_needed, parse_json

SIZE = 2**17
WIDE = '"\U0001f600"]'.encode()


def filled(piece, end=b"0]", start=b"["):
    return start + piece * (SIZE // len(piece)) + end


def many_keys():
    keys = b"{" + b",".join(b'"%d":0' % i for i in range(SIZE // 12)) + b"}"
    return b"[" + keys + b"]"


TEXTS = {
    "lists": filled(b"[],"),
    "lists in lists": b"[" + filled(b"[[[]]],") + b"]",
    "objects": filled(b"{},"),
    "objects with a key": filled(b'{"a":0},'),
    "keys": many_keys(),
    "short texts": filled(b'"ab",'),
    "short texts beyond ASCII": filled('"\U0001f600",'.encode()),
    "short texts and a wide one": filled(b'"ab",', WIDE),
    "a long text": filled(b"a", b'"]', b'["'),
    "a long text, widened at its end": filled(b"a", '\U0001f600"]'.encode(), b'["'),
    "a long text, widened by an escape": filled(b"a", b'\\ud83d\\ude00"]', b'["'),
    "spaces and a wide character": filled(b" ", WIDE),
    "escapes": filled(b"\\u0041", b'"]', b'["'),
    "small numbers": filled(b"0,"),
    "whole numbers": filled(b"999,"),
    "numbers": filled(b"1.5,"),
    "long numbers": filled(b"9" * 4000 + b","),
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_no_text_takes_more_than_the_bound(text):
    memory_needed(text)
    tracemalloc.start()
    try:
        parse_json(text, 10**6)
        taken = tracemalloc.get_traced_memory()[1] + len(text)
    finally:
        tracemalloc.stop()
    assert taken < memory_needed(text)


def test_what_would_take_too_much_is_not_parsed():
    text = TEXTS["lists"]
    tracemalloc.start()
    try:
        with refused(JsonError, "", "JSON that may take", "at most 1,000"):
            parse_json(text, 10, 1000)
        assert tracemalloc.get_traced_memory()[1] < 2**16
    finally:
        tracemalloc.stop()
    with refused(JsonError, "", "JSON that may take"):
        parse_json(text * 240, 10)


def test_whole_numbers_without_end_are_refused():
    with refused(JsonError, "", "no JSON"):
        parse_json(b"9" * 10**6, 10)

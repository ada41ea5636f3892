"""Commands whose NumPy arrays end right before a page that may not be read.

    python tests/support/guarded_memory.py COMMANDS.json

runs the commands, such as ["scenegen", "render", "--n", "2"] or ["python", "import this"], in one
process. A read beyond the end of an array ends it by SIGSEGV. NumPy asks a handler for the memory
of data (NEP 49). This one puts each array of at least LEAST bytes at the end of pages of its own,
before a protected page.
"""

import ctypes
import json
import mmap
import os
import sys
from ctypes import CFUNCTYPE, POINTER, Structure, c_char, c_int, c_size_t, c_uint8, c_void_p
from pathlib import Path

import numpy as np

import cli

LEAST = 512  # bytes; smaller arrays are more than a process may have mappings
SET_HANDLER = 304  # place of `PyDataMem_SetHandler` in the table of numpy's C API
PAGE = mmap.PAGESIZE
WRITABLE = mmap.PROT_READ | mmap.PROT_WRITE

_libc = ctypes.CDLL(None)
_libc.mmap.argtypes = [c_void_p, c_size_t, c_int, c_int, c_int, ctypes.c_long]
_libc.mprotect.argtypes, _libc.munmap.argtypes = [c_void_p, c_size_t, c_int], [c_void_p, c_size_t]
_libc.calloc.argtypes, _libc.realloc.argtypes = [c_size_t] * 2, [c_void_p, c_size_t]
_libc.free.argtypes = [c_void_p]
for name in ("mmap", "calloc", "realloc"):
    getattr(_libc, name).restype = c_void_p

_Malloc = CFUNCTYPE(c_void_p, c_void_p, c_size_t)
_Calloc = CFUNCTYPE(c_void_p, c_void_p, c_size_t, c_size_t)
_Realloc = CFUNCTYPE(c_void_p, c_void_p, c_void_p, c_size_t)
_Free = CFUNCTYPE(None, c_void_p, c_void_p, c_size_t)


class _Handler(Structure):
    """`PyDataMem_Handler` and the allocator in it."""

    _fields_ = [("name", c_char * 127), ("version", c_uint8), ("context", c_void_p),
                ("malloc", _Malloc), ("calloc", _Calloc), ("realloc", _Realloc),
                ("free", _Free)]  # fmt: skip


guarded: dict[int, int] = {}  # sizes of the arrays by their addresses


def _up(size: int, step: int) -> int:
    return -(-size // step) * step


def _malloc(_: int | None, size: int) -> int | None:
    if size < LEAST:
        return _libc.calloc(1, max(size, 1))
    whole = _up(size, PAGE) + PAGE
    start = _libc.mmap(None, whole, WRITABLE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, -1, 0)
    if start == c_void_p(-1).value or _libc.mprotect(start + whole - PAGE, PAGE, 0):
        return None
    address = start + whole - PAGE - _up(size, 16)  # aligned as by malloc
    guarded[address] = size
    return address


def _free(_: int | None, address: int, _size: int) -> None:
    size = guarded.pop(address, None)
    if size is None:
        _libc.free(address)
    else:
        _libc.munmap(address + _up(size, 16) - _up(size, PAGE), _up(size, PAGE) + PAGE)


def _realloc(_: int | None, address: int, size: int) -> int | None:
    if address not in guarded and size < LEAST:
        return _libc.realloc(address, size)
    known = guarded.get(address, LEAST - 1)  # small ones are at least copied as far as they reach
    new = _malloc(None, size)
    if new is not None:
        ctypes.memmove(new, address, min(known, size))
        _free(None, address, 0)
    return new


_calloc = _Calloc(lambda _, count, size: _malloc(_, count * size))
_handler = _Handler(
    b"guarded", 1, None, _Malloc(_malloc), _calloc, _Realloc(_realloc), _Free(_free)
)


def guard() -> None:
    """Put the data of all later arrays of this thread's context before protected pages."""
    capsule = ctypes.pythonapi.PyCapsule_New
    capsule.restype, capsule.argtypes = ctypes.py_object, [c_void_p, ctypes.c_char_p, c_void_p]
    content = ctypes.pythonapi.PyCapsule_GetPointer
    content.restype, content.argtypes = c_void_p, [ctypes.py_object, ctypes.c_char_p]
    table = content(np._core._multiarray_umath._ARRAY_API, None)
    address = ctypes.cast(table, POINTER(c_void_p))[SET_HANDLER]
    set_handler = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(address)
    set_handler(capsule(ctypes.addressof(_handler), b"mem_handler", None))


if __name__ == "__main__":
    guard()
    values = np.arange(LEAST)
    assert values.ctypes.data in guarded
    for program, *words in json.loads(Path(sys.argv[1]).read_text()):
        print(program, *words, flush=True)
        if program == "python":
            exec(words[0], {})
        else:
            getattr(cli, program).main(words, standalone_mode=False)
    os._exit(0)  # Dr.Jit's threads still free arrays when Python can no longer be called

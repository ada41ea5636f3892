"""Values kept in memory: those used last, as many as fit."""

import functools
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import is_dataclass
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np

Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")


class Recent(Generic[Value]):
    """The values used last. Threads may share it.

    Attributes:
        most: sum of the sizes of the values that are kept; a single value may be larger.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self._values: OrderedDict[Hashable, tuple[Value, int]] = OrderedDict()
        self._size = 0
        self._lock = threading.Lock()

    def get(self, key: Hashable) -> Value | None:
        """Return the value of a key, None if it is not kept."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def put(self, key: Hashable, value: Value, size: int | None = None) -> None:
        """Keep a value; forget those that were used longest ago, until the others fit.

        Its size is by default the bytes that it keeps alive.
        """
        size = bytes_alive(value) if size is None else size
        with self._lock:
            if key in self._values:
                self._size -= self._values.pop(key)[1]
            self._values[key] = value, size
            self._size += size
            while self._size > self.most and len(self._values) > 1:
                _, (_, freed) = self._values.popitem(last=False)
                self._size -= freed


def recent(most: int) -> Callable[[Callable[Arguments, Value]], Callable[Arguments, Value]]:
    """Keep the results of a function that were used last, up to so many bytes; none is None."""

    def keeping(function: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
        kept: Recent[Value] = Recent(most)

        @functools.wraps(function)
        def wrapped(*args: Arguments.args, **named: Arguments.kwargs) -> Value:
            key = args, tuple(named.items())
            value = kept.get(key)
            if value is None:
                value = function(*args, **named)
                kept.put(key, value)
            return value

        return wrapped

    return keeping


def bytes_alive(value: Any) -> int:
    """Return the bytes of memory that a value keeps alive.

    These are the arrays, texts and numbers that it reaches through records, tuples, lists, mappings
    and functions. A view of an array counts as all of that array.
    """
    seen, size, todo = set[int](), 0, [value]
    while todo:
        part = todo.pop()
        if id(part) in seen:
            continue
        seen.add(id(part))
        size += sys.getsizeof(part)
        if isinstance(part, np.ndarray):
            todo.append(part.base)
        elif isinstance(part, memoryview):
            todo.append(part.obj)
        elif isinstance(part, tuple | list):
            todo.extend(part)
        elif isinstance(part, dict):
            todo.extend(part.values())
        elif isinstance(part, FunctionType):
            todo.extend(cell.cell_contents for cell in part.__closure__ or ())
        elif is_dataclass(part) and not isinstance(part, type):
            todo.append(vars(part))
    return size

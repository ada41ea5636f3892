"""Changes of one value of a JSON document, named by its place, such as `meta/submissions/0`."""

import copy

GONE = object()  # as a value: the key is taken away


def changed(document, place, value):
    """The document with a value put at a place, or taken away there."""
    other = copy.deepcopy(document)
    *way, last = place.split("/")
    holder = other
    for key in way:
        holder = holder[int(key) if isinstance(holder, list) else key]
    last = int(last) if isinstance(holder, list) else last
    if value is GONE:
        del holder[last]
    else:
        holder[last] = value
    return other


def every_place(document):
    """The place of each key and each member of a list."""
    for key, value in document.items() if isinstance(document, dict) else enumerate(document):
        yield str(key)
        if isinstance(value, (dict, list)):
            yield from (f"{key}/{rest}" for rest in every_place(value))

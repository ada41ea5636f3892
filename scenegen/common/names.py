"""Names that people choose from, such as presets and baselines."""

import difflib
from collections.abc import Collection, Iterable

from scenegen.common.errors import SceneGenError, SpecError


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return a hint with `names` that begin with `name` or are spelled like it; "" for none."""
    lower, wrong = {other.lower(): other for other in names}, name[:60].lower()
    longer = [other for other in lower if wrong and other.startswith(wrong)]
    close = dict.fromkeys([*longer[:3], *difflib.get_close_matches(wrong, lower)])
    return f"did you mean {' or '.join(lower[other] for other in close)}?" if close else ""


def check_choice(
    where: object,
    name: str,
    names: Collection[str],
    error: type[SceneGenError] = SpecError,
    expected: str = "",
) -> None:
    """Raise `error` at `where`, with all names and a hint, unless `name` is one of `names`.

    Args:
        expected: stands for a list of the names.
    """
    if name not in names:
        listed = expected or f"one of {', '.join(names)}"
        raise error(where, f"{name!r:.60}", listed, did_you_mean(str(name), names))

"""Errors whose text is meant for the person at the keyboard.

Every error that a user can cause is a `SceneGenError`. It says where something is wrong, what was
found there, what was expected instead, and what to do about it. The command line prints the text
as one line and exits with code 2; programs and tests read the fields.
"""

from typing import Self


class SceneGenError(ValueError):
    """Base class of errors that are shown to users without a traceback.

    Attributes:
        where: the file, row, setting or option that is wrong, such as `rooms.h5: depth, row 3`.
        found: what was found, or what happened; empty if `where` suffices.
        expected: what was expected instead.
        hint: what the user can do about it.
    """

    def __init__(
        self, where: object, found: object = "", expected: object = "", hint: object = ""
    ) -> None:
        """Keep the fields as texts; all of them go to `args`, so that errors can be pickled."""
        self.where, self.found = str(where), str(found)
        self.expected, self.hint = str(expected), str(hint)
        super().__init__(self.where, self.found, self.expected, self.hint)

    def __str__(self) -> str:
        """Return `where: found ..., expected ...; hint` without the parts that are empty.

        Where nothing is expected, `found` tells what happened, and stands alone.
        """
        found = f"found {self.found}" if self.found and self.expected else self.found
        expected = f"expected {self.expected}" if self.expected else ""
        what = ", ".join(part for part in (found, expected) if part)
        text = f"{self.where}: {what}" if what else self.where
        return f"{text}; {self.hint}" if self.hint else text

    def inside(self, place: object) -> Self:
        """Return the same error with `place` before `where`, such as the file that a row is in."""
        return type(self)(f"{place}: {self.where}", self.found, self.expected, self.hint)


class SpecError(SceneGenError):
    """A setting is out of range or contradicts another one."""


class PlacementError(SceneGenError):
    """The bounded search found no scene that meets the request."""


class FileFormatError(SceneGenError):
    """A file is not what its name or its caller claims, or it is damaged."""


class BackendError(SceneGenError):
    """The requested device cannot render here."""

"""What can go wrong for a user, as exceptions whose text is meant for that user."""


class SceneGenError(ValueError):
    """Base of every error a caller may want to show instead of a traceback."""


class SpecError(SceneGenError):
    """A setting is out of range or contradicts another one."""


class PlacementError(SceneGenError):
    """The bounded search found no scene that meets the request."""


class FileFormatError(SceneGenError):
    """A file is not what its name or its caller claims."""


class BackendError(SceneGenError):
    """The requested device cannot render here."""

"""The two errors that a folder of meshes can cause."""

from scenegen.common.errors import SceneGenError


class MeshFolderError(SceneGenError):
    """A folder does not hold the models that were asked for."""


class BadMeshError(SceneGenError):
    """A model cannot be used. The text says why; reports and notes show it to users."""


def check_most(where: str, count: int, most: int) -> None:
    """Raise BadMeshError where a model has more than `most` of something."""
    if count > most:
        raise BadMeshError(where, count, f"at most {most}", "simplify the model")

"""The two errors that a folder of meshes can cause."""

from scenegen.common.errors import SceneGenError


class MeshFolderError(SceneGenError):
    """A folder does not hold the models that were asked for."""


class BadMeshError(SceneGenError):
    """A model cannot be used. The text says why; reports and notes show it to users."""

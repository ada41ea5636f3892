"""What can be wrong with a folder of meshes, or with one of them."""

from scenegen.common.errors import SceneGenError


class MeshFolderError(SceneGenError):
    """A folder does not hold the models that were asked for."""


class BadMeshError(SceneGenError):
    """A model cannot be used; the text says why, and is fit for a report."""

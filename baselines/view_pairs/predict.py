"""Submissions of `view-pairs`: those of a relief network, which sees one image at a time."""

from pathlib import Path

from baselines.depth_supervised.predict import Progress, submit

METHOD = "view-pairs"
WEIGHTS = Path(__file__).with_name("files") / "unet.safetensors"


def write_submission(
    data: str | Path,
    out: str | Path,
    weights: str | Path = WEIGHTS,
    *,
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write depth and normals of every view of a file of rooms; as `depth_supervised`'s `submit`.

    Args:
        weights: as `bench train view-pairs` writes them; by default those of the package.
    """
    submit(METHOD, data, out, weights, overwrite, progress)

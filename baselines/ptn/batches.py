"""What an iteration of training sees: images, and rays of the silhouettes of several views."""

from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True, eq=False)
class Batch:
    """B images, with R rays each, over all of its views, in the frame of the image's volume.

    Attributes:
        image: linear radiance, (B, 3, S, S).
        camera: position of the image's camera, (B, 3); (B, 0) where the model is not told it.
        origin, direction: of rays through pixels' centres, (B, R, 3).
        silhouette: whether a ray meets the shape, 0 or 1, (B, R).
    """

    image: Tensor
    camera: Tensor
    origin: Tensor
    direction: Tensor
    silhouette: Tensor

"""Depth from one image of a room by a network that saw neighbouring views in training, no depth.

    reprojection.py  what another image shows at the points that an image sees
    matching.py      relief by search: a plane sweep and semi-global matching; nothing is learned
    labels.py        relief of a whole file by matching
    training.py      `train`: matching, then the network of `depth_supervised` on what it found
    predict.py       `write_submission`, from one image and its camera

docs/baselines.md says what it reaches and what it is told.
"""

from scenegen.common.lazy_names import lazy_names

__all__ = ["train", "write_submission"]

__getattr__ = lazy_names(__name__, {"training": "train", "predict": "write_submission"})

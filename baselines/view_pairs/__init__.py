"""Depth from one image of a room by a network that saw neighbouring views in training, no depth.

    training.py  `train`: relief by matching, then the network of `depth_supervised` on it
    predict.py   `write_submission`, from one image and its camera

docs/baselines.md says what it reaches and what it is told.
"""

from scenegen.common.lazy_names import lazy_names

__all__ = ["train", "write_submission"]

__getattr__ = lazy_names(__name__, {"training": "train", "predict": "write_submission"})

"""`depth-match`: mental rotation by depth that a network sees, without labels.

    network.py   depth of a shape from one picture
    training.py  how it learns, from `iqtt make-split --with-depth`
    answers.py   surfaces of two pictures, turned until neither denies the other; submissions

docs/baselines.md says what it reaches and what it is told.
"""

from baselines.depth_match.answers import write_submission
from baselines.depth_match.network import Settings
from baselines.depth_match.training import STREAMED, train

__all__ = ["STREAMED", "Settings", "train", "write_submission"]

"""Depth from one image of a room by a network that was trained with true depth: the ceiling.

    network.py   two networks: with skip connections, and through the reference model's code
    card.py      the card of weights: how they were made
    training.py  `train`, and the iterations that `view_pairs` shares
    predict.py   `write_submission`

docs/baselines.md says what it reaches and what it is told.
"""

from scenegen.common.lazy_names import lazy_names

__all__ = ["train", "write_submission"]

__getattr__ = lazy_names(__name__, {"training": "train", "predict": "write_submission"})

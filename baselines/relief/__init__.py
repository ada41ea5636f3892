"""Depth from one image of a room: `depth-supervised` and `view-pairs`, two ways to learn relief.

    network.py           two networks: with skip connections, and through the reference model's code
    training.py          how they learn, on any targets
    predict.py           submissions
    depth_supervised.py  targets are the true depth
    view_pairs.py        targets are found by matching views of a scene

docs/baselines.md says what each reaches and what it is told.
"""

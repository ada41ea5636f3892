"""Depth from one image of a room: networks that learn relief in four ways.

    network.py           the network: an encoder and a decoder joined at every size
    training.py          how they learn, on any targets, the loss of shape, and what they predict
    depth_supervised.py  targets are the true depth
    view_pairs.py        targets are found by matching views of a scene
    depth_completed.py   what the first view shows, completed for other cameras
    solid_supervised.py  where rays leave solids whose masks and visible surfaces are given

docs/baselines.md says what each reaches and its inputs.
"""

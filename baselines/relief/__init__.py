"""Depth from one image of a room: networks that learn relief in three ways.

    network.py           the network: an encoder and a decoder joined at every size
    shape_loss.py        errors inside objects that no shift of a whole object explains
    training.py          how they learn, on any targets
    predict.py           submissions
    depth_supervised.py  targets are the true depth
    view_pairs.py        targets are found by matching views of a scene
    depth_completed.py   what the first view shows, completed for other cameras

docs/baselines.md says what each reaches and what it is told.
"""

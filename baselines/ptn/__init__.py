"""Perspective Transformer Nets (Yan et al., NeurIPS 2016): voxels learnt from silhouettes alone.

    projection.py   the transformer: a volume seen along the rays of a camera, differentiable
    network.py      settings, card, encoder and volume decoder
    rooms.py        batches of rooms of several views, with silhouettes from images or from ids
    questions.py    batches of polycubes
    matching.py     which of the answers shows the reference's volume
    training.py     what is learned and predicted; start reading here

docs/baselines.md says what it is told that other baselines are not, and what it reaches.
"""

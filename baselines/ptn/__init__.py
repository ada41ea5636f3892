"""Perspective Transformer Nets (Yan et al., NeurIPS 2016): voxels learnt from silhouettes alone.

    projection.py   the transformer: a volume seen along the rays of a camera, differentiable
    network.py      settings, encoder and volume decoder
    batches.py      what an iteration sees
    silhouettes.py  silhouettes of a room's objects, from the image or from ids
    rooms.py        rooms of several views, questions.py  polycubes, as batches
    storage.py      weights, checkpoints and their card
    training.py     `train`
    matching.py     which of the answers shows the reference's volume
    submission.py   `write_submission`

docs/baselines.md says what it is told that other baselines are not, and what it reaches.
"""

"""The reference model: Pix2Shape (IJCV 2020) in torch, an encoder, a decoder and a renderer.

    network/      the networks, the surfel renderer, and the configuration of both
    images.py     images of rooms and of questions, and what the model is told about them
    weights.py    the card of weights, and the weights that come with the package
    pictures.py   pictures of training, samples, interpolations and rotations
    matching.py   relief by search, which training may take for the truth
    training/     losses, steps, and a run
    predict.py    submissions
    commands.py   the command line `pix2shape`

Each may import those above it. Start reading in `network/model.py`, then `training/steps.py`.
docs/pix2shape.md says where the paper leaves something open and what is done here.
"""

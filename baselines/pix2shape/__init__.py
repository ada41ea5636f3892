"""The reference model: Pix2Shape (IJCV 2020) in torch, an encoder, a decoder and a renderer.

    network/     the networks, the surfel renderer, and the configuration of both
    data/        rooms and question files as batches of tensors
    weights/     files of weights, and those that come with the package
    pictures.py  sheets of images, depths and normals; animations
    training/    losses, the training loop, checkpoints
    use/         submissions, samples, interpolations, rotations
    commands.py  the command line `pix2shape`

Each may import those above it. Start reading in `network/model.py`, then `training/steps.py`.
docs/pix2shape.md says where the paper leaves something open and what is done here.
"""

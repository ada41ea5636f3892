"""Rezende et al. (NeurIPS 2016): a mesh deformed from a sphere, behind a renderer without gradients.

    sphere.py      the mesh that is deformed, and the smoothing of its offsets
    rasteriser.py  pictures of meshes, in numpy: the renderer, which can only be sampled
    estimator.py   gradients of an expected loss by sampling it
    network.py     encoder and decoder of the variational model, and the head that labels train
    images.py      what it learns from: question files, or primitives that scenegen renders
    training.py    the loop, its checkpoint and its weights
    reconstruct.py meshes and pictures of trained weights
    answers.py     answers to questions: meshes compared under all rotations, or the head

Each may import those above it. docs/baselines.md says what the paper leaves open and where this
method fails: objects must be alone, centred and without background.
"""

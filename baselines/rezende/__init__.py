"""Rezende et al. (NeurIPS 2016): meshes from images, through a renderer that is only sampled.

    sphere.py       the mesh that is deformed, and the smoothing of its offsets
    rasteriser.py   pictures of meshes, in numpy: the renderer, which can only be sampled
    estimator.py    gradients of an expected loss by sampling it
    network.py      settings, card, encoder and decoder, and the head that labels train
    images.py       what it learns from: the images of question files
    training.py     training on images, and of the head on labels; start reading here
    answers.py      meshes of images, and answers to questions

docs/baselines.md says what the paper leaves open and where this method fails: objects must be
alone, centred and without background.
"""

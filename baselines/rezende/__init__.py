"""Rezende et al. (NeurIPS 2016): meshes from images, through a renderer that is only sampled.

    rasteriser.py   pictures of meshes, in numpy: the renderer, which can only be sampled
    network.py      the mesh that is deformed; encoder, decoder, and the head that labels train
    training.py     training on images, and of the head on labels; start reading here
    answers.py      meshes of images, and answers to questions

docs/baselines.md says what the paper leaves open and where this method fails: objects must be
alone, centred and without background.
"""

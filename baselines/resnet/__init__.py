"""What `cnn` and `siamese` share: a ResNet, and how it learns from labelled questions.

    architecture.py  the ResNet of He et al. (2016)
    methods.py       settings of a run, and files of weights and checkpoints
    answering.py     images of questions, their scores, submissions
    training.py      the training loop

Each may import those above it.
"""

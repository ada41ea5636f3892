"""The paper's two baselines on questions, `cnn` and `siamese`: ResNets that learn from labels.

architecture.py  the ResNet of He et al. (2016)
card.py          settings of a run, and the card of weights
answering.py     scores of a network, accuracy
training.py      what both learn from labelled questions
cnn.py           a softmax over the answers
siamese.py       distances between the features of two images
"""

"""What all trained baselines share: how they learn, what they read, what is stored of them.

    baseline.py     a baseline as data, its training and submissions; start reading here
    checkpoint.py   settings, the card of weights, files of both, and the folder of a run
    machine.py      where and how long a run trains
    fit.py          the training loop
    data.py         files to learn from, which are no named test sets
    images.py       images as networks take them, and batches of them
    rooms.py        images and cameras of rooms
    questions.py    images and answers of questions
    rotations.py    rotations spread evenly

A baseline adds its networks, its batches and its losses. Its module has a `BASELINE`, which says
what it learns and what it predicts; `train` and `write_submission` take it.
"""

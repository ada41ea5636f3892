"""What all trained baselines share: how they learn, what they read, what is stored of them.

    baseline.py     a baseline as data, and its training; start reading here
    submission.py   submissions of trained weights
    checkpoint.py   settings, the card of weights, and files of weights and of checkpoints
    run_folder.py   the folder of a run, which one run has at a time
    processes.py    a batch that several processes share
    launch.py       how Lightning Fabric starts these processes
    machine.py      where and how long a run trains
    fit.py          the training loop
    data.py         files to learn from
    streams.py      rooms and questions to learn from that are rendered meanwhile
    images.py       images as networks take them, and batches of them
    rooms.py        images and cameras of rooms
    questions.py    images and answers of questions
    rotations.py    rotations spread evenly
    test_sets.py    named test sets are not learned from

A baseline adds its networks, its batches and its losses. Its module has a `BASELINE`, which says
what it learns and what it predicts; `baseline.train` and `submission.write_submission` take it.
"""

"""What all trained baselines share: how they learn, what they read, what is stored of them.

    checkpoint.py   the card of weights, and files of weights and of checkpoints
    run_folder.py   the folder of a run, which one run has at a time
    processes.py    a batch that several processes share
    launch.py       how Lightning Fabric starts these processes
    fit.py          the training loop; start reading here
    images.py       images as networks take them
    rooms.py        images and cameras of rooms
    questions.py    images and answers of questions
    submissions.py  the loops that write submissions

A baseline adds its networks, its batches and its losses.
"""

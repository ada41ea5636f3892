"""What all trained baselines share: how they learn, what they read, what is stored of them.

    checkpoint.py   the card of weights, and files of weights and of checkpoints
    run_folder.py   the folder of a run, which one run has at a time
    processes.py    a batch that several processes share
    launch.py       how Lightning Fabric starts these processes
    machine.py      where and how long a run trains
    fit.py          the training loop; start reading here
    data.py         files to learn from
    streams.py      rooms and questions to learn from that are rendered meanwhile
    images.py       images as networks take them, and batches of them
    rooms.py        images and cameras of rooms
    questions.py    images and answers of questions
    rotations.py    rotations spread evenly
    test_sets.py    named test sets are not learned from

A baseline adds its networks, its batches and its losses. Its module has a dataclass `Settings` and
two functions:

`train(data, run_folder, settings, machine, *, resume, progress, ...)` trains on open files of rooms
or questions, `data.TrainingFiles`, and returns the path of the weights. The folder gets checkpoint
and weights. `machine` says where and how long: a `machine.Machine`, by default on a GPU if there is
one. `resume` goes on from the checkpoint, with the run's own settings. `progress` is called after
each iteration with its number, how many there will be, and losses by name. The same arguments
without a limit of time give the same weights on one machine, however often a run is resumed. It
raises SpecError where settings and data do not fit, or there is no such device; FileExistsError
where a new run finds files of another; `fit.TrainingError`; FileFormatError; OSError.

`write_submission(data, out, weights, *, overwrite, progress)` predicts rooms or answers questions.
`weights` is a file that `train` wrote; None for those of the package. `progress` is called with the
rows done since the last call, and those in all. It raises SpecError where weights and data do not
fit; FileFormatError; OSError.
"""

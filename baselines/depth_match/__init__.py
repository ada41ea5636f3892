"""`depth-match`: mental rotation by depth that a network sees, without labels.

    network.py   depth of a shape from one picture
    training.py  how it learns, from `iqtt make-split --with-depth`
    answers.py   surfaces of two pictures, turned until neither denies the other

docs/baselines.md says what it reaches and what it is told.
"""

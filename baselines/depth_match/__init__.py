"""`depth-match`: mental rotation by depth that a network sees, without labels.

    network.py   depth of a shape from one picture; surfaces of two, turned until neither denies
    training.py  how it learns, from `iqtt make-split --with-depth`

docs/baselines.md says what it reaches and what it is told.
"""

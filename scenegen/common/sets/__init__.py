"""Sets of files that are made piece by piece: what is made already, and how the rest is made.

`manifest` records what was asked for and which files are complete; `making` makes the others.
"""

"""What trained models know: one question and one table a file, for the pages in docs.

`material` asks how well materials and lights are read from one image, `pose` how well the angle
between two views is read from z_view, and `rezende_primitives` which kinds of shapes `rezende` can
learn. Each says in its `--help` how it is run.
"""

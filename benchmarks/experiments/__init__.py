"""What trained models know: one question and one table a file. Each tells its use in `--help`.

`material` asks how well materials and lights are read from one image, `pose` how well the angle
between two views is read from z_view, and `rezende_primitives` which kinds of shapes `rezende` can
learn.
"""

"""An explicit 3D solver of mental-rotation questions, which learns nothing.

`segmentation.py` gives each pixel a face direction, `poses.py` finds rotations by the directions of
outlines, `filling.py` fills the lattice of a rotation with cubes, `answer.py` compares the shapes.
The pictures and the settings of a test file are all that is used. Needs numba (the extra `cubes`).
"""

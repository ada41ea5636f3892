"""The frames that vectors may be in by mistake: axes in another order or direction, or the world's.

There are 48 ways to permute and flip three axes. Each is a matrix whose rows say which axis, and
with which sign, holds x, y and z.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.checking.faults import TURNS, axes_letters

Array = NDArray[Any]
AXES = TURNS  # (48, 3, 3); the first one changes nothing
_NAMED = {
    "-x -y -z": "all axes flipped, as if facing away from the viewer",
    "x -y -z": "y down and z forward (OpenCV): both axes flipped",
    "x -y z": "the y axis flipped: y down",
    "x y -z": "the z axis flipped",
    "-x y z": "the x axis flipped, as if mirrored",
    "-x -y z": "x and y flipped",
    "-x y -z": "x and z flipped",
    "z y x": "x and z swapped (BGR for RGB)",
    "z -y -x": "x and z swapped (BGR for RGB) in the frame of OpenCV",
    "-z -y x": "x and z swapped (BGR for RGB) in the frame of OpenCV",
}


def axes_text(matrix: Array) -> str:
    """Return in words what a matrix of AXES undoes: which axes hold x, y and z."""
    letters = axes_letters(matrix)
    return _NAMED.get(letters, f"x, y and z in the axes {letters.replace(' ', ', ')}")


def frame_text(matrix: Array, of_world: bool) -> str:
    """Return in words which frame vectors are in, if a matrix and maybe the pose undo it."""
    changed = not np.array_equal(matrix, AXES[0])
    world = "the world frame, not the camera frame"
    if of_world:
        return f"{world}, with {axes_text(matrix)}" if changed else world
    return axes_text(matrix)

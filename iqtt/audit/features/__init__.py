"""Numbers that describe images and what a file stores; they know nothing of cubes in space."""

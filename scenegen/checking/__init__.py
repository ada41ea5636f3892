"""Cross-checks of folders that others made: do depth, cameras, normals and images agree?

`layouts` reads the views of a folder, `evidence` measures how far they disagree, `faults` undoes
known mistakes and keeps those that explain the disagreement. `folders` puts these together. Nothing
here knows the rooms of this project.
"""

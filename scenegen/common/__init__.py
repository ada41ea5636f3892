"""Helpers that every part of every package uses; none of them knows about rooms or questions.

Errors with fields (`errors`), records as JSON and back (`records`), random numbers (`random`),
files and folders that appear only when complete (`new_file`, `new_folder`), HDF5 files of rows
(`hdf5`), what commands share (`command_line`), worker processes, text tables, and rotations.

It imports nothing else of this project. Start with `errors` and `hdf5.row_file`.
"""

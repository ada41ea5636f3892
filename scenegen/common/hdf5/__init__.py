"""HDF5 files: rows written with digests and axes, and files from anyone opened within bounds.

`row_file` writes tables of rows, whose axes `axes` names, and `content` digests. `input_file` opens
files and reads arrays, after `trial` has tried a file in another process; `attributes` reads texts.
"""

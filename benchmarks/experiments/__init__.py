"""Experiments with a table in docs/: one a file. Each tells its use in `--help`.

`public_sets` draws questions as public generators do, and `robustness` answers disturbed pictures.
"""

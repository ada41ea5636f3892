"""Runs that are killed, stopped, or meet trouble of many kinds, and then go on.

`python -m benchmarks.torture` runs all of it. `runs` starts the commands and compares what they
leave; `cases` has the trouble, and `jobs` has long runs, and those of the size of users' jobs.
"""

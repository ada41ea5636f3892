"""Runs that are killed, stopped, or meet trouble of many kinds, and then go on.

`python -m benchmarks.torture` runs all of it. `runs` starts the commands and compares what they
leave; `cases` and `growth` have the trouble, and `jobs` has runs of the size of users' jobs.
"""

"""The `bench` commands: on submissions, and on the score files of several (`standings`).

Each parses its options, makes one library call, and prints. Heavy imports happen inside the
commands, so that `--help` is fast.
"""

"""The `bench` commands: on submissions, and on the score files of several (`standings`).

`people` has those on people's answers, which are in the group `iqtt`.

Each parses its options, makes one library call, and prints. Heavy imports happen inside the
commands, so that `--help` is fast.
"""

"""What a machine with an NVIDIA GPU does in nine minutes: agreement, speed, training and scores.

`run` says what runs when; `agreement` and `workers` are two of its steps.
"""

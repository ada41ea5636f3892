"""Rooms and question files as batches of tensors: what networks see and losses compare.

Start reading in `rooms.py`, whose `Batch` both files make, and which reads depth maps and classes
only where a loss or a network is told them; `questions.py` adds the answers that training may be
told. Imports `network/`, and the readers of scenegen and iqtt.
"""

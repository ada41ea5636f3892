"""Rooms and question files as batches of tensors: images, cameras and lights, no ground truth.

Start reading in `rooms.py`, whose `Batch` both files make; `questions.py` adds the answers that
training may be told. Imports `network/`, and the readers of scenegen and iqtt.
"""

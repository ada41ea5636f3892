"""Helpers that every part of every package uses; none of them knows about rooms or questions.

Errors with fields (`errors`), records as JSON and back (`records`), random numbers (`random`),
signals, text tables, rotations. It imports nothing else of this project.
"""

"""Scores of the objects alone."""

LEAST_PIXELS = 16

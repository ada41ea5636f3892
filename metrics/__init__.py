"""Scores for predictions."""

"""Scores: plain array functions, arrays in and numbers out."""

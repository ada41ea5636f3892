"""Submissions of our own; they meet the benchmark through its files alone."""

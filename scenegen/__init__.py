"""Rooms with exact ground truth."""

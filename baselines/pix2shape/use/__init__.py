"""What trained weights are good for: submissions (`predict.py`, `answers.py`) and pictures.

Imports everything of pix2shape but the commands.
"""

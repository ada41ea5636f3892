"""What trained weights are good for: `predict.py` writes submissions, `explore.py` draws pictures.

Imports everything of pix2shape but the commands.
"""

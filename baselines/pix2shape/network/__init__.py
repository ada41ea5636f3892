"""What the model computes: the networks, the differentiable surfel renderer, the configuration.

`architecture.py` holds the paper's tables as networks, `surfels.py` the renderer, `config.py` all
settings, and `model.py`, where to start reading, puts them together. Nothing here reads a file;
besides torch only `scenegen.camera` and `scenegen.common` are imported.
"""

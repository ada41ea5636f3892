"""Baselines: trivial ones, trained ones, and the reference model `pix2shape`.

Baselines use the benchmark like any other model: they read files of rooms or questions, and write
submissions. They may import all other packages, and no package imports them. `trivial.py` is a
short start; `commands.py` has `bench baseline` and `bench train`; `pix2shape/` is the reference
model. The other folders are baselines of the paper, which docs/baselines.md describes.
"""

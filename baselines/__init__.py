"""Submissions of our own: trivial ones to beat, and the reference model `pix2shape`.

They meet the benchmark as anybody's model does: they read rooms or question files and write
submission files. They may import all other packages, and nothing imports them. Start reading in
`trivial.py`, which is short; `commands.py` is `bench baseline` and `bench train`, `pix2shape/` the
reference model. The other folders are the paper's baselines; docs/baselines.md has them one by one.
"""

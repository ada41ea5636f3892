"""How the model learns.

`losses.py` holds each loss as a function, the critic's among them; `steps.py`, where to start
reading, says which losses one step minimises. `batches.py` reads the data, `iterations.py` yields
the losses of each iteration, `beginnings.py` has what a run begins from, and `run.py` its folder,
with `logs.py` in it. Imports everything of pix2shape but `predict.py` and the commands.
"""

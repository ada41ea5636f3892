"""How the model learns.

`losses.py` holds each loss as a function, the critic's among them; `steps.py`, where to start
reading, says which losses the steps of each iteration minimise. `batches.py` reads the data,
`beginnings.py` has what a run begins from, and `run.py` its folder and its logs. Imports everything
of pix2shape but `predict.py` and the commands.
"""

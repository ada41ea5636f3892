"""How the model learns.

`losses.py` holds each loss as a function, the critic's among them; `steps.py`, where to start
reading, says which losses one step minimises. `batches.py` reads the data, `loop.py` repeats the
steps, `state.py` is the checkpoint and `runs.py` the folder of a run, with `logs.py` in it. Imports
everything of pix2shape but `use/` and the commands.
"""

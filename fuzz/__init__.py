"""Hostile input for the commands listed in `programs`; docs/security.md says what must hold.

`make fuzz` runs it for 10 minutes; `make test` for some seconds, after the cases that were faults
before (`regressions.jsonl`). A case is a command line that succeeds on honest files, and what was
done to it or to the files. Seed, target and number give the case:

    python -m fuzz --only meshes --seed 7 --seconds 60 --corpus found
    python -m fuzz --replay found/meshes-7-31-3b7f12aa/case.json

`honest` makes the files, `programs` lists the command lines, `cases` draws what is done to them
from the table of `edits`; `child` runs one command within limits, `verdict` says what was wrong
with the run, and `runner` runs cases on all processors and counts.
"""

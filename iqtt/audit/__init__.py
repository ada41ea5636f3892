"""The audit: proofs that the answers are right, and probes that try to guess them without shapes.

Start with `audit`. `table` reads the files; `features` describes their images in numbers; `proofs`
recomputes what must hold of images, shapes, splits and views; `probes` guesses answers from the
numbers of `features`; `report` makes text. The audit shares no code with what it checks: it must
not import `iqtt.shapes` or the modules that draw, render and write questions, so `congruence` finds
out anew which shapes are the same.
"""

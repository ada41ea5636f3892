"""Score files side by side in ranked tables, with the figures that the paper reports.

`ranking` decides which tables there are and in which order methods stand. `rows` fills them,
`floors` has those that are no methods, and `cards` what is known of methods. Start reading in
`ranking`.
"""

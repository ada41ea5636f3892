"""Do methods differ on the same images or questions?

`methods` reads score files, and scores submissions under the common alignment. `pairing` finds the
rows that all of them share and refuses what does not belong together. `compare` computes the
differences, with the `paired_tests`. `report` shows them as text, Markdown, JSON and a page.

Start reading in `compare`.
"""

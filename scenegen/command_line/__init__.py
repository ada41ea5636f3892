"""What the commands of all packages share; with `commands`, the only place that imports click.

`groups` runs commands and shows errors as one line, `options` and `paths` are what commands take,
`output` is what they show, and `streams` keeps pipes and terminals from breaking either.
"""

"""Files of weights: `storage.py` writes and reads them, `bundled.py` finds those of the package.

The bundled weights lie in `files/`; docs/model-card.md says what they are. Imports `network/`
and `data/`.
"""

"""Settings of tiny questions about furnished rooms."""

SETTINGS = {"height": 48, "width": 48, "spp": 1, "angle": (20.0, 60.0), "seed": 3}

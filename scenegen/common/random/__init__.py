"""Random numbers that depend on nothing but what they are for: seed, item, purpose and attempt.

`seeding` makes them, for one item or for many at once; `philox` is the counter-based generator
below it. Start with `seeding.item_numbers`.
"""

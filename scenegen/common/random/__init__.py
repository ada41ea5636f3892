"""Random numbers, each a function of the seed, the item, the purpose and the attempt alone.

`seeding` makes them, for one item or for many at once; `philox` is the counter-based generator
below it. Start with `seeding.item_numbers`.
"""

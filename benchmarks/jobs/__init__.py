"""What a measuring process runs: one function of one module here, by `python -m benchmarks.jobs`.

    rooms          scenegen's own pipeline for rooms, and what the machine offers
    questions      iqtt's pipeline for questions, and plain Mitsuba for the same images
    bare_cast      nothing but the nearest hits of the primary rays
    plain_mitsuba  one `mi.load_dict` and one `mi.render` for each scene
    inputs         scenes and meshes that all of them share
    timing         the clock

Every function returns a record: `seconds` of each repeat, `images`, and a `note`.
"""

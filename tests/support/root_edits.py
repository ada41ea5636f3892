"""What can be wrong with the root of a file of rooms or questions: an edit, and where it is found.

The edits are of a good file; the place is what the error names after the path.
"""

import numpy as np
from h5_edits import attribute, gone

ROOT = {
    "other format": (attribute("format", "other"), ""),
    "format is a number": (attribute("format", 7), "attribute 'format'"),
    "format is an array": (attribute("format", np.arange(3)), "attribute 'format'"),
    **{
        f"version {text}": (attribute("format_version", text), "")
        for text in ("0.9", "2.3", "11.0", "1.x")
    },
    "version is a number": (attribute("format_version", 10.5), "attribute 'format_version'"),
    **{
        f"no {name}": (gone(name), f"attribute '{name}'")
        for name in ("format_version", "writer", "drjit_version", "spec", "fingerprint",
                     "content_digest", "truth_digest")
    },
    "a long writer": (attribute("writer", "x" * 1001), "attribute 'writer'"),
    "variant of two lines": (attribute("variant", "a\nb"), "attribute 'variant'"),
    "release is an array": (attribute("mitsuba_version", np.arange(3)), "attribute 'mitsuba_"),
    "command is a number": (attribute("creation_command", 3), "attribute 'creation_command'"),
    "command is long": (attribute("creation_command", "x" * 4_000_001), "attribute 'creation_c"),
    "fingerprint is a list": (attribute("fingerprint", ["a", "b"]), "attribute 'fingerprint'"),
    "no hexadecimal digest": (attribute("truth_digest", "x" * 64), "attribute 'truth_digest'"),
    **{
        f"spec {text[:9]}": (attribute("spec", text), "attribute 'spec'")
        for text in ("garbage", "[]", "[" * 9000, '{"fog":1}', "[" + " " * 4_000_000 + "]")
    },
}  # fmt: skip

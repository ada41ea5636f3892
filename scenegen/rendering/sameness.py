"""What the bits of rendered pixels depend on, so that machines can be compared."""

import functools
import hashlib

from scenegen.description.specs import DatasetSpec
from scenegen.files.row_file import writer_name
from scenegen.objects.catalogue import objects_of
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render
from scenegen.sampling.scenes import sample_scenes

PIXELS = 64  # on a side


@functools.cache
def renderer_identity(device: str = "auto") -> dict[str, str]:
    """Return the versions of what renders here, and the digest of a small picture.

    Two processors may round differently with the same versions, which only their pixels tell.
    Raises BackendError where the device cannot render here.
    """
    variant = select_variant(device)
    spec = DatasetSpec(seed=0, height=PIXELS, width=PIXELS)
    objects = objects_of(spec)
    _, drawn = sample_scenes(spec, [0] * 8, range(8), objects)
    pixels = render(pack(spec, [drawn.scene(0)], (0,), objects), device).pixels()
    digest = hashlib.sha256(b"".join(pixels[name].tobytes() for name in sorted(pixels)))
    return {
        "writer": writer_name(),
        "variant": variant,
        **versions(),
        "test picture": digest.hexdigest()[:12],
    }

"""Image files: `pictures` reads and writes PNG, JPEG, TIFF and HDR, `exr` OpenEXR."""

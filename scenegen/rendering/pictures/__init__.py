"""Pictures of closed rooms, path-traced by Mitsuba, denoised and developed.

- `matter` gathers a scene's triangles and materials in arrays of the same form for all scenes, so
  that one compiled kernel serves them all; `matter_bsdf` reflects light from them.
- `daylight` is sun and sky, sampled through the windows; `sky` draws what is outside.
- `tracer` traces, `denoiser` removes noise, `development` exposes and applies the tone curve.

Depth, normals and ids do not come from here. Start with `tracer`.
"""

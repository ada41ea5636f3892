"""Pictures of closed rooms, path-traced by Mitsuba, denoised and developed.

- `matter` gathers a scene's triangles and materials in arrays of the same form for all scenes, so
  that one compiled kernel serves them all; `surfaces` looks them up where rays meet them.
- `lights` are sun, sky and lamps, sampled by their power; `sky` draws what is outside.
- `paths` follows light; `tracer` makes pictures of it, `denoiser` removes noise, `development`
  exposes and applies the tone curve.

Depth, normals and ids do not come from here. Start with `tracer`.
"""

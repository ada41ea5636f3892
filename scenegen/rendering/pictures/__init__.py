"""Path-traced pictures, of the paper's rooms and of closed ones.

- `paths` follows light through a `Room`; `paper_rooms` and `closed_rooms` are the two kinds.
  `tracer` makes pictures of them.
- `matter` gathers a closed room's triangles and materials in arrays of the same form for all rooms,
  so that one compiled kernel serves them all.
- `lights` are sun, sky and lamps, sampled by their power; `sky` draws what is outside, `sun` says
  where the sun is.
- `denoiser` removes noise, `development` exposes and applies the tone curve.

Depth, normals and ids do not come from here. Start with `tracer`.
"""

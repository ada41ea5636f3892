"""Rendering: batches of scenes become images with exact ground truth.

- `packing` gathers scenes into arrays, a `SceneBatch`; `renderer` renders one on the best backend;
  `ground_truth` says what the pixels mean: radiance, depth, normal, object id.
- `drjit_renderer` is the fast path: one kernel computes all pixels of a batch. `rays` finds what
  one ray hits and its colour; `cubes` does so faster for polycubes. `meshes` rasterises triangles,
  and holds them in Mitsuba; `surfaces` has the shapes that need none.
- `shading` is the shading equation, with the fall-off of light, in numpy; `pictures` traces paths
  for the colour instead, in the paper's rooms and in closed ones.
- `numpy_renderer` renders the same images slowly, as fallback and as reference for tests.
- `backend` chooses the Mitsuba variant; `pixel_samples` places the samples of `--spp`.

Start with `renderer.render`. This is the only folder that imports Mitsuba and Dr.Jit; of the rest
of `scenegen` it imports `camera`, `common`, `description` and `objects`.
"""

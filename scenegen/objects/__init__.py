"""The objects that one can put into a room: unit shapes, and catalogues of named models.

- `solids.UnitShape` is what every object is made of: a surface and a convex body, of radius 1.
- `basic_shapes` makes boxes, spheres, teapots and the like, `families` makes everyday objects, and
  `meshes` reads models from files. `furniture` makes both fit into closed rooms, with the shell.
- `basic_hulls` holds the hulls of basic shapes as data.
- `cache` keeps on disk what takes long to make.
- `cast_meshes` turns shapes into what the ray caster takes; `coarse_hulls` makes fewer corners
  of a convex body that has very many.
- `catalogue` says which models a data set draws from; `sources` turns the command line's options
  on objects into such a catalogue.
- `scene_mesh` gives the parts of a scene as meshes, for export and for other ray casters.

Start with `catalogue.objects_of`. These files import `common` and `description`, and no renderer.
"""

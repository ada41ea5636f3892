"""Measurements of speed and of results. The packages import nothing of this.

`make bench` runs the first nine, each of which prints one table:

    render      images of rooms a second, beside plain Mitsuba and the bare ray cast
    shapes      CPU time of each basic shape as an exact surface and as a mesh
    models      images a second for scenes of modelled objects, and the cost of `--shading path`
    questions   images of questions a second, beside plain Mitsuba
    nearest     milliseconds of the scorer's nearest neighbours, beside other libraries
    surfels     milliseconds of the reference model's renderer, beside the plain way to write it
    score_rows  milliseconds of `bench score` for one row, in test sets of more and more rows
    quiz        times of the answers of `iqtt quiz` with many participants at once
    viewing     seconds from a move of the slider of a 3D page to the new scene
    experiments what trained models know: materials, angles between views, kinds of shapes
    results     the tables of docs/results.md, from score files
    digests     what two checkouts of the code write, compared part by part

`report` runs jobs in processes of their own and prints their table; `jobs/` is what they run.
"""

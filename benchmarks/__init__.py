"""Measurements of speed and of results. The packages import nothing of this.

`make bench` runs the first six, each of which prints its tables:

    render      images of rooms a second, beside plain Mitsuba and the bare ray cast
    shapes      CPU time of each basic shape as an exact surface and as a mesh
    questions   images of questions a second, beside plain Mitsuba
    nearest     milliseconds of the scorer's nearest neighbours, beside other libraries
    surfels     milliseconds of the reference model's renderer, beside the plain way to write it
    score_rows  milliseconds of `bench score` for one row, in test sets of more and more rows
    gpu         whether a GPU draws what the CPU draws, and how fast
    cluster     images a second of worker processes and of a Dask cluster
    torture     runs that are killed or meet trouble, and then go on
    results     the commands behind the tables of docs/results.md and docs/results-rooms.md
    experiments questions of public generators, and answers to disturbed pictures
    digests     what two checkouts of the code write, compared part by part

`timing` runs functions in processes of their own and prints their table.
"""

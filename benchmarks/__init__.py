"""Measurements of speed and of results. The packages import nothing of this.

`make bench` runs those that docs/speed.md shows, each of which prints its tables:

    rendering   rooms, questions, streams and interiors: images a second, beside plain Mitsuba
    scoring     the scorer's nearest neighbours, and the cost of rows of `bench score`
    surfels     milliseconds of the reference model's renderer, beside the plain way to write it

The others run by name:

    gpu         whether a GPU draws what the CPU draws, and how fast
    torture     runs that are killed or meet trouble, and then go on
    results     the commands behind the tables of docs/results.md and of docs/data
    public_sets questions as public generators draw them
    digests     what two checkouts of the code write, compared part by part

`timing` runs functions in processes of their own and prints their table.
"""

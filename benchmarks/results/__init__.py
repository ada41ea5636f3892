"""The tables of docs/results.md, by the commands that anyone can type: python -m benchmarks.results

    steps.py      commands that are run once, and whose products are kept
    rows.py       a row of a table: training runs, their predictions, one score file for each column
    questions.py  Table 3: the accuracy of every method on every kind of question
    rooms.py      scores of rooms, as in Tables 1 and 2
    perturbations.py  what each score sees: the truth spoilt in one way at a time, as a picture
    studies.py    which parts of the paper's objective matter

Everything is kept in one folder. A product is not made again if the same commands made it from the
same files, so `make results` can be stopped and started again.
"""

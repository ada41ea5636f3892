"""The tables of docs/results.md, by the commands that anyone can type: python -m benchmarks.results

    steps.py      commands that are run once, and whose products are kept
    questions.py  Table 3: the accuracy of every method on every kind of question
    rooms.py      scores of rooms, as in Tables 1 and 2
    studies.py    the ablations of the paper: losses, depth supervision, mutual information
    markdown.py   tables, and where they go in docs/results.md

Everything is kept in one folder. What is there already, and was made by the same commands from the
same files, is not made again: stop it when you like, and start it again.
"""

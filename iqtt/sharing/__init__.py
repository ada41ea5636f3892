"""What others need to use files of questions: rows in formats of machine learning, and data cards.

`published` says which files of a split are handed out, and `withheld` refuses any that would tell
the answers of test questions. `questions` says what an export, an index and a card hold; how they
are written is in `scenegen.sharing`.
"""

"""What others need to use files of questions: rows in formats of machine learning, and data cards.

`published` opens what is handed out of a split, and refuses any file that would tell the answers of
test questions. `questions` says what an export, an index and a card hold; how they are written is
in `scenegen.sharing`.
"""

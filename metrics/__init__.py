"""Scores of predicted rooms and answers, and everything that is said about them.

`measures` turn arrays into numbers; `submissions` are the files that models hand in; `scoring`
joins both; `report`, `comparison` and `leaderboard` show scores; `commands` are what `bench` runs.
Doors for other programs: `prediction_writer` writes submissions, `score_file` reads scores. Imports
neither a renderer nor torch.
"""

"""The quiz: one page, without a server, on which people answer mental-rotation questions.

`page` writes it, from `quiz.js` and `quiz.css`. Each participant's answers come back as a JSON
file, which `metrics.intake.answers.quiz_answers` makes a submission.
"""

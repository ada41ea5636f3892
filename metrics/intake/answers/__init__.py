"""Answers to questions become submissions.

`asking` asks a model with Inspect, `harness_logs` reads what programs logged that ask models,
`answer_files` reads lists of answers, and `quiz_answers` those of people.
"""

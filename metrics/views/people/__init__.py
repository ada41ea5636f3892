"""What people's answers to questions tell, beside models; `iqtt.quiz` asks them.

`figures` computes all numbers of a report from the answers, with the formulas of `intervals`, and
`report` shows them. `references` is what a participant sees beside the own score, and `submission`
makes a file of people's answers that `bench score` reads.
"""

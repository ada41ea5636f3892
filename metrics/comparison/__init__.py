"""Do methods differ? Score files of one test set are compared with the first of them.

`pairing` refuses files that do not belong together and finds their common rows, `statistics` holds
the tests, `compare` applies them to each score, and `report` and `page` show the result.

All but `page`, which shows pictures, read no submission and no truth, only the scores of each item:
they import `metrics.measures` and `metrics.scoring`. Start reading in `compare`.
"""

"""Questions for models that read pictures and text, and the answers that come back.

`pictures` draws a question anew at any size, `prompt` says what is asked, and `rows` joins both for
each order of the answers. `export` writes the rows for Inspect, lmms-eval, VLMEvalKit and other
readers of Parquet. `reading` finds the answer in a model's text.
"""

"""The paper's first baseline on questions: a CNN with a softmax over the answers.

`train` and `write_submission` are in `network.py`, and are loaded when they are first used.
"""

from scenegen.common.lazy_names import lazy_names

__getattr__ = lazy_names(__name__, {"network": "train write_submission"})

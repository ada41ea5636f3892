"""Scores of predicted rooms and answers, and everything that is said about them.

Score predictions in memory:   `metrics.evaluate(predictions, "rooms.h5").metrics["relief_iou"]`
Those of one room:             `metrics.evaluate_room(depth, rooms[0])["relief_iou"]`

`measures` turn arrays into numbers; `submissions` are the files that models hand in; `scoring`
joins both; `views` and `viewing` show scores; `commands` are what `bench` runs. `intake` makes
submissions of models and folders of files.
Doors for other programs: `prediction_writer` writes submissions, `score_file` reads scores. Imports
neither a renderer nor torch.
"""

from typing import TYPE_CHECKING

from scenegen.common.lazy_names import lazy_names

if TYPE_CHECKING:
    from metrics.in_memory import evaluate as evaluate
    from metrics.in_memory import evaluate_room as evaluate_room

HOMES = {"in_memory": "evaluate evaluate_room"}
__all__ = [name for names in HOMES.values() for name in names.split()]
__getattr__ = lazy_names(__name__, HOMES)

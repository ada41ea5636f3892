"""Metrics of predicted rooms and of responses to questions, with reports and comparisons.

Score predictions in memory:   `metrics.evaluate(predictions, "rooms.h5").metrics["relief_iou"]`
Score one room:                `metrics.evaluate_room(depth, rooms[0])["relief_iou"]`

`measures` turn arrays into numbers; `submissions` are the files of predictions; `scoring` joins
both; `views` and `viewing` show scores; `commands` are the commands of `bench`. `intake` makes
submissions from models and from folders of files.
Entry points for other programs: `prediction_writer` writes submissions, `score_file` reads scores.
The package imports neither a renderer nor torch.
"""

from typing import TYPE_CHECKING

from scenegen.common.lazy_names import lazy_names

if TYPE_CHECKING:
    from metrics.in_memory import evaluate as evaluate
    from metrics.in_memory import evaluate_room as evaluate_room

HOMES = {"in_memory": "evaluate evaluate_room"}
__all__ = [name for names in HOMES.values() for name in names.split()]
__getattr__ = lazy_names(__name__, HOMES)

"""Functions of the task `iqtt` of lmms-eval; they need pix2shape-bench to be installed."""

from iqtt.vlm.harness import (
    accuracy,
    circular_accuracy,
    doc_to_text,
    doc_to_visual,
    process_results,
    skill,
    unparsed,
)

__all__ = [
    "accuracy",
    "circular_accuracy",
    "doc_to_text",
    "doc_to_visual",
    "process_results",
    "skill",
    "unparsed",
]

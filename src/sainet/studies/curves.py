"""The learning curve of a training run."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sainet.learning.log import LogLine
from sainet.report.figures.learning import draw_learning_curve


def draw_history(model: str, log: Sequence[LogLine], path: Path) -> Path:
    """Draw the loss of training and, where it was measured, of validation.

    Args:
        model: slug of the network, whose label stands beside the curve. Equal logs of
            one model give the same bytes, whatever folder the training wrote.
        log: the lines of the training log.
        path: file to write; ``.svg`` or ``.png``.
    """
    checked = [line for line in log if line.validation_loss is not None]
    history = (
        np.array([line.iteration for line in log]),
        np.array([line.loss for line in log]),
        np.array([line.iteration for line in checked]),
        np.array([line.validation_loss for line in checked]),
    )
    return draw_learning_curve({model: history}, path)

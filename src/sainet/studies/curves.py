"""The learning curve of a training run."""

from pathlib import Path

import numpy as np

from sainet.learning.fit import FitResult
from sainet.report.figures.learning import draw_learning_curve


def draw_history(result: FitResult, path: Path) -> Path:
    """Draw training and, if it was measured, validation loss over iterations."""
    lines = result.history
    checked = [line for line in lines if "validation_loss" in line]
    history = (
        np.array([line["iteration"] for line in lines]),
        np.array([line["loss"] for line in lines]),
        np.array([line["iteration"] for line in checked]),
        np.array([line["validation_loss"] for line in checked]),
    )
    return draw_learning_curve({result.folder.name: history}, path)

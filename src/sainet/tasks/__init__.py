"""Tasks of the robot: goals drawn as in the paper, and costs for the planners."""

from typing import Literal

Goals = Literal["easy", "hard"]

"""Tasks of the robot: goals drawn as in the paper, and costs for the planners."""

"""What a robot is asked for: tasks, their costs, and goals drawn as in the paper."""

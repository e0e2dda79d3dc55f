"""How far predictions are from what happened, with intervals."""

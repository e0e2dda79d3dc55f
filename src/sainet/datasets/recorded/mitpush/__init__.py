"""The MIT Push dataset: pushes known at their ends, and raw recordings."""

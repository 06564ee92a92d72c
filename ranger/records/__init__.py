"""The records of a walk as arrays, and its summary."""

"""`ranger-sim campaign`: the command, and the page of its results."""

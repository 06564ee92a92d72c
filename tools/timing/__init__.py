"""`ranger-sim slots` and `trace`: who needs a board's time, and the timeline of a run."""

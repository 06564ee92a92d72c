"""`ranger-sim slots` and `trace`: use of a board's time, and the timeline of a run."""

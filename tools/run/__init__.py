"""`ranger-sim walk`, `up` and `ctl`: options of a run, its checks, and the folder that it writes."""

"""`ranger-sim walk`, `up` and `ctl`: what can be asked of a run, what is watched, and the folder that it leaves."""

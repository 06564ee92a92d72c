"""Studies of the robot: comparisons, searches, figures. Not in the wheel; in a checkout `python -m studies.NAME`."""

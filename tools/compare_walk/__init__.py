"""`ranger-sim compare-walk`: a walk that the robot logged beside the walk of the emulated robot with its controller."""

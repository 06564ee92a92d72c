"""`ranger-sim compare-walk`: compare a walk logged by the robot with one of the emulated robot with its controller."""

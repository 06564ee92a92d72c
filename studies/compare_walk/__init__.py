"""`python -m studies.compare_walk`: a walk logged by the robot, and the emulated robot's with the same controller."""

"""Faults at physical places of the robot, with proof that they acted."""

"""Sensors that show the robot's state to the boards: encoders, feet, inertial unit, and noise (EQUATIONS 11)."""

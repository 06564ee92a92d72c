"""What shows the boards how the robot stands: encoders, feet, the inertial unit, and their noise (EQUATIONS 11)."""

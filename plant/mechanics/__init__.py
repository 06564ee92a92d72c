"""The body and its motion: legs, feet, joints, floor, and how they move (EQUATIONS 1 to 7, 9, 14)."""

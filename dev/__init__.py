"""What the developers use and a user has no use for: not in the wheel. Run from the top of a checkout."""

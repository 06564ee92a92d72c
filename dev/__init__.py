"""Tools for developers, not for users: not in the wheel. Run from the top of a checkout."""

"""The faults that only the robot has, its places for those of any machine, and what its boards record."""

"""`ranger-sim diagnose-figures`: which number of the simulated robot is wrong, from published or measured figures."""

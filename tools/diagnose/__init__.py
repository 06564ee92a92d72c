"""`ranger-sim diagnose`: causes of a misfit between measured data and a simulation, by name."""

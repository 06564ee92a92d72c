"""The main brain: estimator, concurrent state machines, modes, and the controller parameter sets."""

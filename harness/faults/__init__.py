"""Faults at physical places of a machine, with proof that they acted."""

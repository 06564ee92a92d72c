"""The base of every package: numbers, stamped events, seeded randomness, and the only wall clock."""

"""The ground every room stands on: numbers, stamped events, seeded randomness, and the one wall clock."""

"""The ground every room stands on: numbers, stamped events, seeded randomness, and the one wall clock."""

if __name__ != "ranger_sim.foundation":
    raise ImportError("foundation is a room of ranger_sim: import ranger_sim.foundation")

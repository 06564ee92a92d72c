if __name__ != "ranger_sim.can_bus":
    raise ImportError("can_bus is a room of ranger_sim: import ranger_sim.can_bus")

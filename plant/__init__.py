if __name__ != "ranger_sim.plant":
    raise ImportError("plant is a room of ranger_sim: import ranger_sim.plant")

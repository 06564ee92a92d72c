if __name__ != "ranger_sim.tools":
    raise ImportError("tools is a room of ranger_sim: import ranger_sim.tools")

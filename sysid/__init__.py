if __name__ != "ranger_sim.sysid":
    raise ImportError("sysid is a room of ranger_sim: import ranger_sim.sysid")

if __name__ != "ranger_sim.harness":
    raise ImportError("harness is a room of ranger_sim: import ranger_sim.harness")

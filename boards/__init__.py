if __name__ != "ranger_sim.boards":
    raise ImportError("boards is a room of ranger_sim: import ranger_sim.boards")

"""Power sources and loads: battery, bridges, motors, and the electronics (EQUATIONS 10)."""

"""Where the power comes from and goes: battery, bridges, motors, and what the electronics draw (EQUATIONS 10)."""

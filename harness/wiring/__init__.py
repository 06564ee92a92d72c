"""The wires of a machine, as tables: which sensor and motor is on which pin, which board on which bus."""

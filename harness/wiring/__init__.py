"""The wires of a machine, as tables: which sensor and motor hangs on which pin, which board on which bus."""

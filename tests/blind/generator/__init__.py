"""Makes measured data with a hidden effect; shares no model code with the diagnosis (tests/blind/README.md)."""

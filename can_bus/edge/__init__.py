"""Where the emulated buses meet the CAN world: python-can messages and candump logs. The only such place."""

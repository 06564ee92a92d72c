"""The robot in tests: its backends, single boards and buses, replays."""

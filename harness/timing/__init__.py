"""Slot timing: what had a board's processor and when, for tests and tables; and a static check beforehand."""

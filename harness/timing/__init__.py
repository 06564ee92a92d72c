"""Slot timing: who had a board's processor when, as tests ask and as a table shows; and what can be said beforehand."""

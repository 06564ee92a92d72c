"""Timelines of a run: their model, what any machine shows in them, and the formats of their files."""

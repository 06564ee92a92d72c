"""The report of a walk: one self-contained page."""

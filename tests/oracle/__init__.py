"""Figures of a run found a second time: from its files, by code that shares nothing with ranger/records/summary.py."""

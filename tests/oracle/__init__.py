"""Figures of a run found a second time: from its files, by code that shares nothing with harness/records/summary.py."""

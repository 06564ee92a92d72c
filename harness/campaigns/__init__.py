"""Campaigns: many runs of one plan, each with a fault or a changed parameter, and their totals."""

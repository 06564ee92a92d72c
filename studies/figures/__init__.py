"""Diagnosis from figures: a few published or measured numbers instead of time series (README of `sysid`)."""

"""Shared by all commands: typed values, tables of options, the console, whole files."""

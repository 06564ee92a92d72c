"""The campaigns' parts, from the intervals to a killed worker."""

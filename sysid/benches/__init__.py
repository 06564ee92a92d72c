"""Virtual benches: each returns what a real one would record, with its instruments' noise, quantisation and offsets.

What is measured is the plant: its motor model and its bodies' numbers. Physics that a bench adds is written here.
"""

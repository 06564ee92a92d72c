"""Motor stages by their own meters: the tables of docs/explanation/motor-power.md.

The robot's logs next to what is known of them otherwise, and emulated drives whose truth is known.
"""

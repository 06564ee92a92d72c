"""Boards that run other firmware: in C, as an image of the chip, and restarted in place of a board."""

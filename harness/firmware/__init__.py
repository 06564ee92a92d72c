"""Boards that run firmware from elsewhere: in C, as an image of the chip, and started anew in a board's place."""

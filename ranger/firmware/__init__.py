"""Boards of the robot that run other firmware: in C, or an image of the chip."""

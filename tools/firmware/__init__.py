"""A user's firmware on the command line: in C, as an image for the chip, with a debugger."""

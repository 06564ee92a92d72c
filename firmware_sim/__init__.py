"""A microcontroller as its program sees it: clock, slot scheduler, interrupts, cycle costs, peripherals.

This package knows nothing of any particular robot; README.md in this folder shows a complete board.
"""

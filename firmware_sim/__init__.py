"""A microcontroller as its program sees it: clock, slot scheduler, interrupts, cycle costs, peripherals.

Nothing of any particular robot is known here; README.md beside this file shows a complete board.
"""

"""A microcontroller as its program sees it: clock, slot scheduler, interrupts, cycle costs, peripherals.

Nothing of any particular robot is known here; README.md beside this file shows a complete board.
"""

if __name__ != "ranger_sim.firmware_sim":
    raise ImportError("firmware_sim is a room of ranger_sim: import ranger_sim.firmware_sim")

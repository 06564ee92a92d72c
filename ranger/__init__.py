"""The robot itself: what is wired how, its conditions, faults, records and tests; the harness passes its time."""

"""The robot as operating-system processes: one per board, one for the plant, one that supervises them.

README.md here describes how they communicate. The board and plant classes are those of the lockstep: a board process
runs `Microcontroller.advance`, the plant process runs `harness.lockstep.Lockstep`.
"""

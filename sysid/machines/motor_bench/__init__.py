"""A geared brushed motor on the bench: `machine.py` has its balances, a file each what may be wrong with them."""

from ranger_sim.sysid.machines.motor_bench.machine import MotorBench

__all__ = ["MotorBench"]

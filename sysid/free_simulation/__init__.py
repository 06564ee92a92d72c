"""A machine given by its simulator: fitted in the simulation, diagnosed as a linear regression.

An equation error needs every derivative of the measured signals, and a noisy column biases the residual. Here nothing
measured is differentiated. The simulator's trajectory is fitted to the recording, parameters and all (`fit.py`);
along it the simulator is linearised, for all samples together (`simulator.py`):

    x[k+1] = f(x[k], u[k], p) + noise of the inputs          states, measured inputs, parameters
    y[k]   = h(x[k], u[k], p) + noise of the sensors         outputs that were measured

    response   the simulation's error in the outputs, one step ahead
    columns    the outputs' sensitivities to the parameters: the forward sensitivity equations
    effects    the outputs' first-order response to an extra torque, voltage or sensor's error at a port

All three (`linearised.py`) pass one linear, time-varying filter, the Kalman predictor of the linearised simulator
(`predictor.py`). It makes the residual white: a sensor's noise stays unchanged, an input's noise is followed through
the machine, and an initial state is projected out. With exact inputs it is the output error of multiple shooting,
segment by segment (`horizon_s`) with free initial states; the trajectory itself is found by multiple shooting with
segments of one sample (Bock 1987), whose gaps are closed as far as the inputs' noise does not explain them. So a
distant start converges, and errors do not accumulate in a machine that forgets nothing.

A named effect acts in the simulator from then on (`acting.py`): trajectory, parameters and its own size are fitted
together, so that a large effect is not judged by its first order about a model without it. What other numerics would
move its size by is its numerical floor (`numerical_floor.py`). The gain of an extension is measured in simulations that
run freely over windows.

A user's machine is a subclass of `SimulatedMachine` (`declared.py`, `terms.py`, `integration.py`; what every machine
can have: `candidates.py`); `examples/servo_arm.py` is a complete one.
"""

from ranger_sim.sysid.forms import filtered
from ranger_sim.sysid.free_simulation.integration import Quantities, held, runge_kutta, standing
from ranger_sim.sysid.free_simulation.machine import SimulatedMachine
from ranger_sim.sysid.free_simulation.recording import SimulatedRecording
from ranger_sim.sysid.free_simulation.terms import Joint, Output, Port, Ports, Shape, SimulatedEffect, Term, into

# for machines, which need nothing else
__all__ = [
    "Joint", "Output", "Port", "Ports", "Quantities", "Shape", "SimulatedEffect", "SimulatedMachine",
    "SimulatedRecording", "Term", "filtered", "held", "into", "runge_kutta", "standing",
]  # fmt: skip

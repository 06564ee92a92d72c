from libc.math cimport cos, sin
from ranger_sim.plant.mechanics.body cimport HELD, Body
from ranger_sim.plant.mechanics.friction cimport smoothed_sign
from ranger_sim.plant.mechanics.leg cimport Leg
from ranger_sim.plant.mechanics.parts cimport Ankle, HipJoint
from ranger_sim.plant.mechanics.term_torques cimport TermTorques

cpdef void in_air(Body body, double h, long long stages)

from libc.math cimport cos, sin
from ranger_sim.plant.body cimport HELD, Body
from ranger_sim.plant.friction cimport smoothed_sign
from ranger_sim.plant.leg cimport Leg
from ranger_sim.plant.parts cimport Ankle, HipJoint
from ranger_sim.plant.term_torques cimport TermTorques

cpdef void in_air(Body body, double h, long long stages)

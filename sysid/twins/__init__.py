"""A walk compared with its twins: sound emulated walks, and emulated walks with one cause each.

steps       a log on an even clock, cut into steps
features    some hundred numbers per step
step_map    what a sound robot's step is, given the state at its start; learned from sound twins
twin_file   maps, scatter and directions of a controller, as they ship with the package
judgement   which cause moves the steps of a walk away from those of sound twins, how far, and since when
evidence    that judgement as a part of a diagnosis
"""

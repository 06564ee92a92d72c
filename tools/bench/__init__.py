"""`ranger-sim bench`: speed of the whole and its parts, walks over many seeds, and bounds against simulations.

`command` lists the parts by name, `cases` the timed cases, `traffic` the load for the bus (compiled, so that the
figures are those of the bus); code of one part alone is in a module of that name.
"""

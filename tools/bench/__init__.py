"""`ranger-sim bench`: how fast the whole and its parts are, how far the robot walks, how well bounds hold.

`command` has the parts by name, `cases` what is timed, `traffic` the load for the bus (compiled, so that the figures
are those of the bus); what belongs to one part only is in a module of that name.
"""

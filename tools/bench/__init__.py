"""`ranger-sim bench`: how fast the whole and its parts are, how far the robot walks, how well bounds hold.

`command` lists the parts by name, `cases` the timed cases, `traffic` the load for the bus (compiled, so that the
figures are those of the bus); code of one part alone is in a module of that name.
"""

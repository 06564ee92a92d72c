"""A debugger for boards whose processor runs machine code: the remote serial protocol of gdb, over TCP."""

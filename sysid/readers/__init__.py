"""Files as datasets: one module per format, and `formats`, which knows them. `sysid.reading` reads with them."""

"""On-chip and directly wired peripherals, named as the LPC2194 user manual names them."""

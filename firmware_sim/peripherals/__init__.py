"""On-chip and directly wired peripherals, named as the LPC2194 user manual names them."""

import foundation  # noqa: F401  (first: it chooses compiled or interpreted modules)

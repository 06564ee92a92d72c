"""Where the emulated buses meet the CAN world: python-can messages and candump logs. The only such place."""

import foundation  # noqa: F401  (first: it chooses compiled or interpreted modules)

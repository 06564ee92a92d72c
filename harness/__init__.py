import foundation  # noqa: F401  (first: it chooses compiled or interpreted modules)

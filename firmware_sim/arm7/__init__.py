"""An ARM7TDMI that runs a board's own flash image: the core, its memory, and how images are read."""

"""Walks with hidden causes, drawn at test time, and what the comparison with twins says about them.

It knows nothing of how the diagnosis makes its twins (`ranger_sim.tools.twins`): kinds, seeds, floors and batteries are
drawn here, and walks are made by the emulator's own scenario files.
"""

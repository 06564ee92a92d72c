"""The Cornell Ranger biped emulated whole: seven boards' firmware, four CAN buses, one walking body.

The rooms (`ranger_sim.boards`, `ranger_sim.plant`, ...) are top-level folders of the repository; importing this package
finds them and chooses, once for all of them, whether compiled or plain modules run (`ranger_sim.loading`).
"""

from ranger_sim import loading  # noqa: F401  (first: it finds the rooms)

__version__ = "0.1.0"

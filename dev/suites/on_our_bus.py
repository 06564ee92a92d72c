"""A pytest plugin for another project's tests: its buses of interface `virtual` are ours instead. `-p on_our_bus`."""

from typing import Any


def pytest_collection_modifyitems() -> None:
    """Puts our bus in the place of `virtual`. Not earlier: python-can keeps sys.stdout as it is when it is imported."""
    import can

    from ranger_sim.can_bus.edge.python_can import RangerSimBus

    class Substitute(RangerSimBus):
        """Takes the options of `virtual`; a silent node acknowledges, so that tests with one node run."""

        def __init__(
            self,
            channel: Any = None,
            receive_own_messages: bool = False,
            rx_queue_size: int = 0,
            can_filters: Any = None,
            **others: Any,
        ) -> None:
            for name in ("preserve_timestamps", "protocol"):
                others.pop(name, None)
            if rx_queue_size:
                others["rx_queue_size"] = rx_queue_size
            super().__init__(
                "none" if channel is None else channel,
                can_filters,
                private=True,
                acknowledge=True,
                receive_own_messages=receive_own_messages,
                **others,
            )

    globals()["Substitute"] = Substitute
    can.interfaces.BACKENDS["virtual"] = (__name__, "Substitute")

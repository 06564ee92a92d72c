"""Power drawn by computers, sensors and radio: 5.15 W itemised, 4.7 W without the left outer ankle.

The total is the appendix's P_fixed (1.1.2). The router board measures it, because it feeds all of the electronics
"except for the motors and motor drivers" (3.8), through a converter from the battery to 5.5 V (3.6). The 65 km
walk ran at 4.7 W because the left outer ankle was switched off, board and sensor (3.8). These two are 0.2 W each,
so the 0.45 W saved put the converter's efficiency at 0.40 / 0.45 = 8/9, and everything else sums to that.
"""

from ranger_sim.foundation.user_error import ModelError, unknown

TOTAL_W = 5.15  # appendix 1.1.2
EFFICIENCY = 8.0 / 9.0  # battery to 5.5 V, from the two totals (see above)

# Item, watts at 5.5 V, source.
ITEMS = (
    ("main brain", 0.370, "appendix 3.3"),
    ("router board", 0.200, "appendix 3.7 for boards of that processor module: under 0.2 W"),
    ("user interface board", 0.200, "as the router board"),
    ("hip board", 0.200, "appendix 3.7: under 0.2 W without motor and MOSFETs"),
    ("outer feet board", 0.200, "appendix 3.7"),
    ("inner feet board", 0.200, "appendix 3.7"),
    ("steering board", 0.200, "appendix 3.7"),
    ("left outer ankle board", 0.200, "appendix 3.7; off on the 65 km walk (3.8)"),
    ("hip absolute encoder", 0.200, "appendix 3.8: four of about 0.2 W"),
    ("right outer ankle absolute encoder", 0.200, "appendix 3.8"),
    ("inner ankle absolute encoder", 0.200, "appendix 3.8"),
    ("left outer ankle absolute encoder", 0.200, "appendix 3.8; off on the 65 km walk"),
    ("hip motor encoder", 0.100, "appendix 3.8"),
    ("outer ankle motor encoder", 0.050, "appendix 3.8"),
    ("inner ankle motor encoder", 0.050, "appendix 3.8"),
    ("inertial sensor", 0.400, "data sheet of the 3DM-GX3-25: 80 mA at 5 V"),
    ("four foot sensors", 0.400, "chosen by us: 20 mA of diode current from 5 V each, the data sheet's test current"),
    ("steering angle sensor", 0.035, "chosen by us: 7 mA at 5 V, a usual Hall sensor"),
    ("Bluetooth module", 0.165, "chosen by us: 50 mA at 3.3 V while connected"),
    ("radio receiver", 0.100, "chosen by us: 20 mA at 5 V, a usual hobby receiver"),
    ("display, lights, buzzer, keys", 0.200, "chosen by us: two of six lights on at 10 mA per colour"),
)
# Optional parts: those that no emulated board reads, under the name used in a scenario.
LEFT_OUTER_ANKLE = ("left outer ankle board", "left outer ankle absolute encoder")
SWITCHES = {"left-outer-ankle": LEFT_OUTER_ANKLE}


def itemised_W(off: tuple[str, ...] = ()) -> dict[str, float]:
    """Watts at the battery by item, those of `off` left out: names of items, or of a group of SWITCHES.

    "carrier board and bus, unnamed" is the rest of the measured total after the named items.
    """
    items = {name: watts for name, watts, _ in ITEMS}
    items["carrier board and bus, unnamed"] = TOTAL_W * EFFICIENCY - sum(items.values())
    for name in off:
        for item in SWITCHES.get(name, (name,)):
            if item not in items:
                raise ModelError(f"electronics: {unknown('item', item, items)}")
            del items[item]
    items["converter loss"] = sum(items.values()) * (1.0 / EFFICIENCY - 1.0)
    return items


def power_W(off: tuple[str, ...] = ()) -> float:
    """Power of the electronics at the battery, W; `off` as for `itemised_W`."""
    return sum(itemised_W(off).values())

"""Faults of the servo, in addition to those of controllers and bus, which follow from the wiring: two places.

The encoder's modes are those of any incremental encoder (`ranger-sim`'s harness/faults/edges.py).
"""

from ranger_sim.harness.faults import kinds
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Place
from ranger_sim.harness.faults.sensor import Quantity, mode_classes
from ranger_sim.harness.faults.voltages import VoltageFault

CURRENT = "current amplifier"
LEAD = "motor lead"
PLACES = (
    Place("DRIVE.encoder", kinds.EDGES, "the encoder at the arm, 1000 edges a turn", {"encoder": 0}),
    Place("DRIVE.current", CURRENT, "the amplifier's voltage at the converter", {"board": "DRIVE", "voltage": 0}),
    Place("DRIVE.lead", LEAD, "a lead between bridge and motor"),
)

AMPERES = Quantity(
    unit="A",
    typical=1.0,
    limit=6.6,
    clip_low=-1.0,
    clip_high=1.0,
    open_value=-6.6,
    source="chosen by us: a third of the largest command; the amplifier ends at 6.6 A, an open wire reads 0 V",
)
for each in mode_classes(VoltageFault, CURRENT, AMPERES):
    mode(each)


@mode
class OpenLead(Fault):
    """The lead is off its terminal: no current, whatever the bridge does."""

    mode = "open"
    kinds = (LEAD,)
    meaning = "carries no current"
    unit = "A"

    def begin(self, now_ns):
        self.robot.plant.lead.open = True

    def after(self, start_ns, end_ns):
        if missing_A := self.robot.plant.driven_A():
            self.note(start_ns, -missing_A)

    def finish(self, now_ns):
        self.robot.plant.lead.open = False

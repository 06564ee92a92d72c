"""One sentence for each cause of the catalogue: the check on the machine after the cause was named.

In our own words, from the practice of motors, gearboxes, cables, encoders and CAN; a figure in a sentence is a rule of
thumb for a size worth checking.
"""

from ranger_sim.sysid.causes import CAUSES

# by the key of the cause; a sensor's identifier alone is for places that the catalogue does not distinguish
LOOK_AT = {
    "contact_drop_change": (
        "Brushes and commutator: worn or glazed brushes, weak springs, film or oil on the bars; hold the shaft, step "
        "the current, and turn the shaft a little between readings."
    ),
    "resistance_temperature": (
        "The winding's heat: read its resistance at the leads right after a hard run; copper adds 0.39 % per kelvin, "
        "so put the temperature into the model, and look at cooling if it is hotter than it should be."
    ),
    "torque_constant_temperature": (
        "The magnets: turn the motor at a known speed cold and hot and read its open voltage; ferrite loses 0.2 % per "
        "kelvin and recovers, what does not come back was demagnetised by too much current."
    ),
    "inductance_frequency": (
        "The winding and the series inductor on an LCR meter at 100 Hz, 1 kHz and the PWM frequency; a core that "
        "saturates shows at rated current."
    ),
    "pwm_ripple": (
        "The ripple with a current probe faster than the PWM: above a tenth of the rated current it asks for a higher "
        "frequency or more series inductance."
    ),
    "dead_time": (
        "Both leads of the bridge on a scope where the current crosses zero: dead time set in the gate driver or "
        "timer, and a transistor that leaves the current to its diode."
    ),
    "battery_sag": (
        "The supply at the drive's own terminals under load, not at the pack: cells, fuse, connectors, crimps and "
        "cable; a bad crimp is warm."
    ),
    "charge_drift": (
        "The pack's voltage at rest before and after the run, the balance of its cells, and whether the firmware "
        "divides its duty by the measured supply."
    ),
    "current_step_at_zero_duty": (
        "When and where the current is sampled: the ADC's trigger against the PWM edge, the amplifier's common-mode "
        "rejection, and ground shift; the jump sits where the duty changes sign."
    ),
    "sensor_scale@current": (
        "The current sensor against a clamp meter at three currents of each sign: shunt, gain resistors, ADC "
        "reference, and the scale constant in the firmware."
    ),
    "sensor_offset@current": (
        "The current reading with the bridge off, cold and warm: amplifier offset, a Hall core magnetised by an "
        "overload, and whether the firmware zeroes it at power-up."
    ),
    "voltage_clip": (
        "The duty next to the battery's voltage in the log: supply too low for the speed, a duty or current limit in "
        "the firmware, or an integrator that has run to its stop."
    ),
    "cogging": (
        "The unpowered rotor by hand, slowly: count the detents per turn against slots and poles; an ironless motor "
        "has none, so there look for a rubbing rotor or a damaged gear tooth."
    ),
    "commutation_ripple": (
        "The commutator: count the periods per turn against its bars (twice the bars if odd), and watch the "
        "resistance at the leads while turning slowly; one bad bar or shorted coil stands out."
    ),
    "once_per_turn": (
        "What is out of centre: run-out of shaft, pulley and gear with a dial gauge, a cable that climbs over itself, "
        "a harness that is dragged round."
    ),
    "coulomb_friction": (
        "The joint by hand with a spring balance: bearing preload, a misaligned coupling, seals, brush pressure, a "
        "tight cable; then whether the model's value was measured on this machine."
    ),
    "viscous_friction": "The lubricant: kind, amount and temperature of the grease, an overfilled bearing or gearbox.",
    "stribeck": (
        "Slow motion through zero: dry or too thin lubricant, plain bearings and seals that grip before they slide; a "
        "loop that hunts at low speed is its companion."
    ),
    "presliding": (
        "A torque below break-away, slowly applied and removed: a give that springs back is pre-sliding in seals, "
        "bearings and gear teeth; free travel would be backlash."
    ),
    "load_friction": (
        "The gearbox's efficiency: drive the load, then let the load drive, at the same torque; look at tooth wear, "
        "lubricant, and side load on the output bearing."
    ),
    "direction_friction": (
        "Both directions by hand: brush angle, a one-sided preload or seal lip, a harness or weight that pulls one "
        "way; a constant difference may as well be the zero of the torque or current sensor."
    ),
    "friction_warm_up": (
        "The same run cold and after half an hour of motion: stiff grease; warm up before measuring, or take a "
        "lubricant for this temperature."
    ),
    "cable_backlash": (
        "The joint rocked with the motor held: free travel is a slack cable, a loose set screw or key, a worn tooth "
        "or coupling; tension it and look at crimps and pulley screws."
    ),
    "cable_stiffening": (
        "The held joint loaded in steps: strands that bed in, too little preload, a cable that touches a guard; pre- "
        "stretch and tension again."
    ),
    "cable_creep": (
        "A constant load held for a minute: motion that goes on is creep of polymer rope, knots and terminations; "
        "pre-load it for hours, tension again, or take steel."
    ),
    "pulley_slip": (
        "Paint marks across cable and pulley: a mark that has moved is slip; clamp screw, number of turns, oil on the "
        "pulley; then set the zero again."
    ),
    "hip_spring_bend": (
        "The spring pulled in steps to both sides: coils that touch, an end that lifts, a lever arm that changes with "
        "the angle."
    ),
    "return_spring": (
        "The return spring unhooked and the run repeated: its line of action over the angle, coils that bind, rubber "
        "that has aged."
    ),
    "eccentricity": (
        "The encoder's seat: run-out of disc or magnet (0.05 mm matters), tilt and air gap; turn by hand against a "
        "second encoder."
    ),
    "lost_counts": (
        "The count at each index pulse, slowly and then fast: input filter and highest frequency of the quadrature "
        "timer, line driver and termination, decoding in an interrupt that comes too late."
    ),
    "sensor_lag": (
        "What filters or delays the signal: the sensor's own filter setting, RC at the ADC, averages in the firmware, "
        "the slot that samples it, the frame that carries it; step the quantity and scope raw against logged."
    ),
    "bit_flip": (
        "The encoder's serial line: clock rate for its length, termination, shield and ground near the motor leads; "
        "use parity or CRC, or read twice and count the differences."
    ),
    "clock_drift": (
        "Stamps of both boards over some minutes: crystal or RC oscillator, stamps taken at reception instead of at "
        "sampling, a low-priority CAN identifier that waits for the bus."
    ),
    "gyro_misalignment": (
        "The machine turned about the vertical by hand: a rate about the hip is a turned sensor; its mounting plate, "
        "and the rotation matrix in the firmware."
    ),
    "sensor_scale@gyro": (
        "A turn by a known angle against a square, integrated: the range bits in the sensor's register and the factor "
        "that goes with them."
    ),
    "sensor_offset@gyro": (
        "A minute at rest, cold and warm: the mean is the zero; when the firmware takes it, and what temperature and "
        "supply do to it."
    ),
    "leg_asymmetry": (
        "Each leg on a scale and balanced on an edge, lengths by tape: batteries, boards, harness or repairs that one "
        "side has and the other has not."
    ),
    "floor": (
        "A spirit level along the path (1 mrad is 1 mm in a metre), seams and carpet; the same path walked the other "
        "way separates floor from robot."
    ),
    "contact_loss": "The soles: wear, soft rubber, dust, a loose foot; film one strike from the side.",
    "drag": (
        "What moves fluid: too much grease or oil that is churned, a fan, a flapping harness; it goes with the square "
        "of the speed, so run at half of it."
    ),
    "geometry": (
        "Tape and calliper: foot height at the middle of the sole, hip to ankle, radius of the sole; then what was "
        "mounted since the drawing: soles, spacers, other feet."
    ),
    "inertia": (
        "The parts on a scale, balanced on an edge, swung as a pendulum; then what was added since the model: "
        "battery, covers, harness, payload."
    ),
    "spring_value": (
        "The spring against a scale at a known arm: wire, active coils, hooks, pretension, where it is anchored."
    ),
    "sensor_offset@angle": (
        "The joint at its stop or in a jig: the zero in the calibration file, a magnet or disc that slipped on its "
        "shaft, a stop that was moved."
    ),
    "firmware_parameter": (
        "The parameters read back from the board, not from the file: an old set in flash, a unit or sign at the "
        "interface, a gain that a state of the controller replaces."
    ),
    "sensor_offset": (
        "The sensor's reading where its quantity is zero, cold and warm: amplifier offset, zeroing at power-up, a "
        "load that was not taken off."
    ),
    "sensor_scale": (
        "The sensor against a second one at three values of each sign: its sensitivity, gain resistors, ADC "
        "reference, and the factor in the firmware or the logger."
    ),
}
# words in the name of a place, and the catalogue's place for them
PLACES = {"current": "current", "_A": "current", "gyro": "gyro", "angle": "angle", "_rad": "angle"}


def look_at(cause: str, at: str = "") -> str:
    """The sentence for a cause (its identifier) at a place; empty for a cause that is not in the catalogue."""
    for word, place in PLACES.items():
        if f"{cause}@{place}" in LOOK_AT and (word in at if not word.startswith("_") else at.endswith(word)):
            return LOOK_AT[f"{cause}@{place}"]
    return LOOK_AT.get(cause, "")


def meaning(cause: str, at: str = "") -> str:
    """The catalogue's text for a cause, for a sentence; the identifier in words for a cause not in the catalogue."""
    same = [each for each in CAUSES.values() if each.identifier == cause]
    if len(same) == 1:
        return same[0].meaning
    if cause in ("sensor_offset", "sensor_scale") and at:
        return f"{at} shows " + ("a constant too much or too little" if cause == "sensor_offset" else "a multiple")
    return cause.replace("_", " ")

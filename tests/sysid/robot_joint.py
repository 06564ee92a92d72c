"""A joint of a robot arm as a user writes it: I = J a + F_v v + F_c sgn v + offset, current per unit of each.

With `gravity` in the base: + cos q + sin q, which otherwise is a candidate.
"""

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.machine import Effect, Equation, Known, Quantity, Recording

SLOW = 0.01  # rad/s


class Joint:
    name = "robot-joint"
    quantities = (
        Quantity("angle_rad", "rad", "of the joint"),
        Quantity("rate_rad_per_s", "rad/s", "of the joint"),
        Quantity("current_A", "A", "of the motor", drives=False),
    )
    parameters = (
        Known("inertia_As2_per_rad", "A s^2/rad", 0.1, 0.0, 100.0, "of the joint, in current"),
        Known("viscous_As_per_rad", "A s/rad", 1.0, 0.0, 100.0, "friction"),
        Known("coulomb_A", "A", 0.5, 0.0, 50.0, "friction"),
        Known("offset_A", "A", 0.0, -5.0, 5.0, "of the sensor"),
    )
    gravity = False

    def prepare(self, table):
        table = signals.uniform(table)
        q, v = table["angle_rad"], table["rate_rad_per_s"]
        s = {"q": q, "v": v, "a": np.gradient(v, table.step_s), "sgn": np.tanh(v / SLOW)}
        s["t"] = table.time_s - table.time_s[0]
        columns = {"inertia_As2_per_rad": s["a"], "viscous_As_per_rad": v, "coulomb_A": s["sgn"]}
        columns["offset_A"] = np.ones_like(v)
        if self.gravity:
            columns |= {"cos_A": np.cos(q), "sin_A": np.sin(q)}
        moving = ~signals.resting(table, v)
        return Recording(
            table, s, {"current": Equation("current", "M", "mechanical", "A", table["current_A"], columns, moving)}
        )

    def generic(self, recording):
        return {"current": {name: recording.signals[name] for name in ("q", "v", "a", "t")}}

    def effects(self, recordings):
        top = max(float(np.quantile(np.abs(each.signals["v"]), 0.98)) for each in recordings)
        speeds = [{"speed": share * top} for share in (0.02, 0.05, 0.1, 0.2, 0.4)]

        def one(name, make, shapes=({},), coefficients=("size",)):
            return Effect(name, "joint", "mechanical", coefficients, list(shapes),
                          lambda r, p, _: {"current": np.column_stack(make(r.signals, p))})  # fmt: skip

        found = [
            one("drag", lambda s, _: [s["v"] * np.abs(s["v"])]),
            one("cubic", lambda s, _: [s["v"] ** 3]),
            one("root", lambda s, _: [s["sgn"] * np.sqrt(np.abs(s["v"]))]),
            one("direction", lambda s, _: [np.abs(s["v"])]),
            one("stribeck", lambda s, p: [s["sgn"] * np.exp(-((s["v"] / p["speed"]) ** 2))], speeds),
            one("spring", lambda s, _: [s["q"]]),
            one("drift", lambda s, _: [s["t"]]),
            one("warm_up", lambda s, _: [s["sgn"] * s["t"]]),
            one("lag", lambda s, _: [np.gradient(s["a"])]),
            one("ripple", lambda s, p: [np.cos(p["n"] * s["q"]), np.sin(p["n"] * s["q"])],
                [{"n": n} for n in (3.0, 4.0, 6.0, 8.0)], ("cosine_A", "sine_A")),
        ]  # fmt: skip
        if not self.gravity:
            found.append(one("gravity", lambda s, _: [np.cos(s["q"]), np.sin(s["q"])], ({},), ("cosine_A", "sine_A")))
        return found


class HeavyJoint(Joint):
    gravity = True

"""What is common to the experiments: which effects are hidden where, how strongly, and the files that are measured."""

import copy

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from tests.blind.generator.bench import Lanes
from tests.blind.generator.case import Case
from tests.blind.generator.excitation import STEP_S
from tests.blind.generator.instruments import Instruments, write
from tests.blind.generator.strength import Scale

BATCH = 80  # cases simulated side by side: memory, not speed, sets it
STRENGTHS = (0.5, 1.0, 2.0, 4.0)
WITH_ONE = ("single", "confusable", "outside")  # kinds with one effect, whose likeness to causes is told
HOTTEST_C = 150.0  # of a housing: no small motor survives more; chosen by us
AGAIN = 8  # trajectories that are tried for a case before it is given up
# With its effect no machine turns so many times as fast as without: chosen by us. An effect that hides in the base
# parameters along one trajectory (friction by direction, where all motion is in one) would need a size beyond all.
RUNAWAY = 5.0
TIE = 0.95  # of the cosine of two effects' parts outside the base model
# One replaces the friction of the other; one shows what the other shows. Such two are not two effects.
NO_PAIR = ({"presliding", "stribeck"}, {"load_friction", "sensor_scale"})
SUBSYSTEM = {"E": "electrical", "M": "mechanical", "EM": "current_sensing", "T": "transmission", "t": "timing"}
SUBSYSTEM |= {"S": "angle_sensing", "C": "firmware"}


def cosine(one, other):
    """Of the angle between two vectors, without sign."""
    length = np.linalg.norm(one) * np.linalg.norm(other)
    return float(abs(one @ other) / length) if length > 0.0 else 0.0


class Experiment:
    """An experiment's cases. What a subclass says:

    NAME, COLUMNS       of the experiment; {column of the files: channel}
    NOMINAL, FIXED      base parameters that are shifted in every case, and those that are known
    NOISE               standard deviations by channel
    EFFECTS             {name: Effect} that this experiment can hide: CAUSES of the catalogue and OUTSIDE it
    SHADOWS             ((cause, show), ...): causes of the catalogue at other places, which are not hidden here but may
                        look like what is; show as an Effect's
    CONFUSABLE          causes that the poor experiment cannot distinguish
    MIX                 shares of the kinds in a set of cases
    ONLY_IN             {balance: causes that show in it alone, or nearly}; CHECK_AT_4 of each, and CHECK_KINDS, are
                        the subset for continuous integration
    SAMPLES             of a run
    MOVES_RAD_S         speed below which friction takes what it must, so that the torque balance says nothing
    excite              (rng, supply_V, poor) -> voltage and brake torque
    """

    SHADOWS = ()

    def lasting(self, seconds):
        """The same experiment with runs of another length; strengths keep their meaning, for N_eff goes with it."""
        other = copy.copy(self)
        other.SAMPLES = round(seconds / STEP_S)
        return other

    def plan(self, seed, count, kinds, causes):
        """Cases without files: kinds in the shares of MIX, causes in turn, strengths in turn for each kind."""
        mix = [(kind, share) for kind, share in self.MIX if kind in kinds]
        total = sum(share for _, share in mix)
        wanted = []
        for kind, share in mix:
            wanted += [(kind, None, None)] * round(count * share / total)
        wanted = (wanted + [(mix[0][0], None, None)] * count)[:count]
        return self.fill(seed, wanted, causes)

    def check_plan(self, seed):
        """The subset for continuous integration, 52 cases of the motor bench: by ONLY_IN and CHECK_KINDS."""
        rng = generator(seed, "check plan")
        wanted = []
        for names in self.ONLY_IN.values():
            order = rng.permutation(names)
            wanted += [("single", str(order[i % len(order)]), 4.0) for i in range(self.CHECK_AT_4)]
        for kind, count in self.CHECK_KINDS:
            wanted += [(kind, None, 2.0 if kind == "single" else None)] * count
        return self.fill(seed, wanted, self.CAUSES)

    def fill(self, seed, wanted, causes):
        """Cases from [(kind, cause or None, strength or None)], in random order; what is None goes in turn."""
        rng = generator(seed, "plan")
        order = {
            "single": [str(name) for name in rng.permutation(causes)],
            "outside": [str(name) for name in rng.permutation(self.OUTSIDE)],
            "confusable": [str(name) for name in rng.permutation(self.CONFUSABLE)],
        }
        turns = dict.fromkeys(("null", "pair", *order), 0)
        cases = []
        for kind, name, strength in wanted:
            turn = turns[kind]
            turns[kind] += name is None
            case = Case(0, kind)
            if kind == "null":
                case.variant = ("plain", "parameters", "noise")[turn % 3]
            elif kind == "pair":
                two = rng.choice(causes, 2, replace=False)
                while len(causes) > 2 and {*map(str, two)} in NO_PAIR:
                    two = rng.choice(causes, 2, replace=False)
                case.effects = [(str(one), 2.0) for one in two]
            else:
                round_, place = divmod(turn, len(order[kind]))
                # every strength for every cause after four rounds
                usual = {
                    "single": STRENGTHS[(place + round_ + seed) % 4],
                    "outside": 4.0,
                    "confusable": (2.0, 4.0)[turn % 2],
                }
                case.effects = [(name or order[kind][place], strength or usual[kind])]
                case.poor = kind == "confusable"
            cases.append(case)
        cases = [cases[i] for i in rng.permutation(len(cases))]
        for number, case in enumerate(cases):
            case.number = number
        return cases

    def prepare(self, seed, case):
        """Base parameters, instruments and the conditions of both runs of a case."""
        rng = generator(seed, f"case {case.number}")
        low, high = (0.20, 0.40) if case.variant == "parameters" else (0.05, 0.15)
        case.base = {
            name: value * (1.0 + rng.choice((-1.0, 1.0)) * rng.uniform(low, high))
            for name, value in self.NOMINAL.items()
        } | self.FIXED
        louder = rng.uniform(2.0, 3.5) if case.variant == "noise" else 1.0
        noise = {name: value * louder * rng.uniform(0.8, 1.3) for name, value in self.NOISE.items()}
        case.instruments = Instruments(noise, float(rng.uniform(0.80, 0.93)), self.COLUMNS)
        supply_V = rng.uniform(5.6, 6.6)
        # the held-out run: another trajectory, another level of the supply, another room
        case.runs = []
        for name, level in (("a", 1.0), ("b", float(rng.choice((0.82, 1.15))))):
            volt, brake = self.excite(generator(seed, f"case {case.number} run {name}"), supply_V * level, case.poor)
            case.runs.append((name, volt, brake, float(rng.uniform(16.0, 32.0)), float(rng.uniform(0.0, 15.0))))
            case.supplies_V.append(supply_V * level)
        for name, _ in case.effects:
            effect = self.EFFECTS[name]
            case.shapes.append(effect.draw(generator(seed, f"case {case.number} {name}")))
            case.signs.append(float(rng.choice((-1.0, 1.0))) if effect.sign else 1.0)

    def excite_again(self, seed, case, attempt):
        """Other trajectories for a case, in the same conditions."""
        for place, ((name, _, _, *conditions), supply_V) in enumerate(zip(case.runs, case.supplies_V, strict=True)):
            rng = generator(seed, f"case {case.number} run {name} again {attempt}")
            case.runs[place] = (name, *self.excite(rng, supply_V, case.poor), *conditions)

    def lanes_of(self, pairs):
        """Lanes for [(case, run)]."""
        base = {name: np.array([case.base[name] for case, _ in pairs]) for name in pairs[0][0].base}
        runs = [run for _, run in pairs]
        return Lanes(
            base,
            np.column_stack([run[1] for run in runs]),
            np.column_stack([run[2] for run in runs]),
            np.array([run[3] for run in runs]),
            np.array([run[4] for run in runs]),
        )

    def calibrate(self, case, scale):
        """Amplitudes that give the wanted strengths along the trajectory without effects."""
        for (name, wanted), shape, sign in zip(case.effects, case.shapes, case.signs, strict=True):
            effect = self.EFFECTS[name]
            if effect.linear:
                unit = scale.strength(effect.show(scale.trajectory, shape))
                if unit <= 0.0:
                    raise ValueError(f"case {case.number}: {name} does not show in this run")
                case.amplitudes.append(sign * wanted / unit)
                continue
            low, high = 0.0, effect.start
            while scale.strength(effect.show(scale.trajectory, shape, high)) < wanted and high < 10.0:
                low, high = high, 2.0 * high
            for _ in range(10):
                middle = 0.5 * (low + high)
                if scale.strength(effect.show(scale.trajectory, shape, middle)) < wanted:
                    low = middle
                else:
                    high = middle
            case.amplitudes.append(0.5 * (low + high))

    def balances(self, name, trajectory, shape, amplitude):
        """What an effect adds to the balances."""
        effect = self.EFFECTS[name]
        if not effect.linear:
            return effect.show(trajectory, shape, amplitude)
        return tuple(amplitude * part for part in effect.show(trajectory, shape))

    def rivals(self, seed, case, scale):
        """{other cause: cosine} with the case's only effect, along its trajectory."""
        (name, _), shape = case.effects[0], case.shapes[0]
        own = scale.outside(self.balances(name, scale.trajectory, shape, case.amplitudes[0]))
        found = {}
        for other in self.CAUSES:
            if other == name:
                continue
            effect = self.EFFECTS[other]
            drawn = effect.draw(generator(seed, f"case {case.number} {other}"))
            turns = "once_per_turn" in (name, other)  # its period is its own
            own_keys = {"by_V"} | ({"periods"} if turns else set())  # these make them two different causes
            drawn |= {key: shape[key] for key in drawn if key in shape and key not in own_keys}
            theirs = scale.outside(self.balances(other, scale.trajectory, drawn, effect.start))
            found[other] = cosine(own, theirs)
        for other, show in self.SHADOWS:
            if other != name:
                found[other] = max(found.get(other, 0.0), cosine(own, scale.outside(show(scale.trajectory, {}))))
        return found

    def scale(self, case, trajectory):
        """What measures the strength of effects along a trajectory."""
        return Scale(trajectory, case.instruments, self.MOVES_RAD_S)

    def true_channels(self, trajectory):
        """What ideal instruments would show."""
        t = trajectory
        joint = {"q": t.theta / t.base["G"]}
        return joint | {"V": t.V, "I": t.I, "w": t.w, "T": t.T, "theta": t.theta, "temperature": t.housing_C}

    def apply_instruments(self, case, trajectory, true):
        """Changes the true channels by the effects that sit in instruments."""
        for (name, _), shape, amplitude in zip(case.effects, case.shapes, case.amplitudes, strict=True):
            if self.EFFECTS[name].measure is not None:
                self.EFFECTS[name].measure(true, trajectory, amplitude, shape)

    def let_act(self, lanes, cases):
        """Puts the effects that act in the bench into the lanes, one lane per entry of `cases`."""
        for lane, case in enumerate(cases):
            for (name, _), shape, amplitude in zip(case.effects, case.shapes, case.amplitudes, strict=True):
                if self.EFFECTS[name].law:
                    lanes.add(lane, self.EFFECTS[name].law, amplitude, shape)

    def measure(self, seed, case, run, trajectory):
        """The columns of a run's file."""
        true = self.true_channels(trajectory)
        self.apply_instruments(case, trajectory, true)
        return case.instruments.show(generator(seed, f"case {case.number} noise {run[0]}"), true)

    def parameters(self, case, effect, scale, shown, amplitude, shape):
        """What a right answer finds: the effect's own numbers, or those of the catalogue's form that comes nearest.

        shown: the effect's balances.
        """
        if effect.like is None:
            return effect.tell(amplitude, shape, case.base)
        own, best = scale.outside(shown), (-1.0, {})
        for others, unit in effect.like(scale.trajectory):
            column = scale.outside(unit)
            square, product = float(column @ column), float(own @ column)
            if square > 0.0 and product * abs(product) / square > best[0]:
                best = product * abs(product) / square, {effect.size: product / square, **others}
        return best[1]

    def truth(self, case, scale, cosines):
        """What only the scorer may know."""
        causes = []
        for (name, wanted), shape, amplitude in zip(case.effects, case.shapes, case.amplitudes, strict=True):
            effect = self.EFFECTS[name]
            shown = self.balances(name, scale.trajectory, shape, amplitude)
            causes.append(
                {
                    "name": name,
                    "in_catalogue": effect.known,
                    "balance": effect.balance,
                    "subsystem": SUBSYSTEM[effect.balance],
                    "strength": wanted,
                    "strength_reached": scale.strength(shown),
                    "r": scale.r(shown),
                    "n_eff": scale.n_eff,
                    "share_by_balance": scale.shares(shown),
                    "amplitude": amplitude,
                    "shape": shape,
                    "parameters": self.parameters(case, effect, scale, shown, amplitude, shape),
                }
            )
        return {
            "experiment": self.NAME,
            "number": case.number,
            "kind": case.kind,
            "variant": case.variant,
            "causes": causes,
            "ties": sorted(name for name, cosine in cosines.items() if cosine > TIE),
            "cosines": {name: round(value, 3) for name, value in sorted(cosines.items(), key=lambda item: -item[1])},
            "base": case.base,
            "noise": case.instruments.noise,
            "memory": case.instruments.memory,
        }

    def generate(self, seed, cases, data, tell=lambda text: None):
        """Writes data files of planned cases below `data`; yields (id, files, holdout, truth) of each.

        Two passes of simulation: without effects, which sets the amplitudes, and with them.
        """
        for start in range(0, len(cases), BATCH):
            batch = cases[start : start + BATCH]
            for case in batch:
                self.prepare(seed, case)
            ran = self.simulate(batch)
            for attempt in range(AGAIN):
                wild = [place for place, trajectories in enumerate(ran) if runs_away(*trajectories)]
                if not wild:
                    break
                for place in wild:
                    self.excite_again(seed, batch[place], attempt)
                for place, trajectories in zip(wild, self.simulate([batch[each] for each in wild]), strict=True):
                    ran[place] = trajectories
            else:
                raise ValueError(f"cases {[batch[place].number for place in wild]}: no machine stands such an effect")
            tell(f"{len(batch)} cases simulated without and with effects")
            for case, (_, *trajectories) in zip(batch, ran, strict=True):
                key = generator(seed, f"name of case {case.number}").bytes(6).hex()
                (data / key).mkdir(parents=True)
                for run, trajectory in zip(case.runs, trajectories, strict=True):
                    write(data / key / f"{run[0]}.csv", self.measure(seed, case, run, trajectory))
                scale = self.scale(case, trajectories[0])
                cosines = self.rivals(seed, case, scale) if case.kind in WITH_ONE else {}
                yield key, [f"{key}/a.csv"], [f"{key}/b.csv"], self.truth(case, scale, cosines)

    def simulate(self, cases):
        """Of each case: its trajectory without effects, which sets their amplitudes, and its runs with them."""
        plain = self.lanes_of([(case, case.runs[0]) for case in cases]).run(fine=4)
        for case, trajectory in zip(cases, plain, strict=True):
            case.amplitudes.clear()
            self.calibrate(case, self.scale(case, trajectory))
        pairs = [(case, run) for case in cases for run in case.runs]
        lanes = self.lanes_of(pairs)
        self.let_act(lanes, [case for case, _ in pairs])
        with np.errstate(over="ignore", invalid="ignore"):  # what runs away is looked for afterwards
            ran = lanes.run()
        return [(plain[place], *ran[2 * place : 2 * place + 2]) for place in range(len(cases))]


def runs_away(plain, *trajectories):
    """True when a run is much faster than the one without effects, is not a motion at all, or would burn the motor."""
    fastest = RUNAWAY * float(np.max(np.abs(plain.w)))
    return any(not (np.max(np.abs(each.w)) <= fastest and np.max(each.housing_C) <= HOTTEST_C) for each in trajectories)

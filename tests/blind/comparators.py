"""What a diagnosis must beat on the same cases, through the same JSON; each a function (files, holdout, experiment).

    refit_only        refits the base model and is content
    majority_label    says the same cause of everything
    gaussian_process  learns what the base model leaves, and can name nothing; needs scikit-learn
    sindy             picks polynomial terms for it; needs pysindy
    without_balance   any diagnosis that is deaf to what shows in one balance (a wrapper)

`python -m tests.blind.answers --by NAME` runs one; a diagnosis of one's own is `--by module:function`.
"""

import warnings

import numpy as np

LEVEL = 3.0  # standard errors by which a learned term must be better on blocks it has not seen
BLOCK = 50  # samples averaged: what noise with a memory of 0.9 needs to forget


def said(detected=False, subsystem=None, causes=(), abstained=False, gain=None, holdout=""):
    """An answer in the form of `ranger-sim diagnose --json`."""
    return {
        "detected": detected,
        "misfit": [],
        "subsystem": subsystem,
        "causes": [
            {"name": name, "balance": subsystem, "parameters": {}, "tied_with": [], "evidence": {}} for name in causes
        ],
        "abstained": abstained,
        "gain": {"fraction_of_achievable": gain, "ci95": None, "holdout": holdout},
        "next_experiment": [],
        "model_file": None,
        "data_findings": [],
    }


def read(path):
    """{column: values} of a file of numbers with a head; NaN where a cell is empty."""
    with open(path, encoding="ascii") as file:
        names = file.readline().strip().split(",")
        values = np.genfromtxt(file, delimiter=",")
    return dict(zip(names, values.T, strict=True))


def smooth_rate(time_s, values, half=8):
    """Derivative by a straight line through 2 half + 1 samples."""
    weights = np.arange(half, -half - 1, -1.0)
    weights /= np.sum(weights**2) * np.median(np.diff(time_s))
    return np.convolve(values, weights, mode="same")


def motor_bench(t):
    """{balance: (inputs that a learner may use, what is explained, columns that explain it, rows)}."""
    V, current, w, T = (t[n] for n in ("voltage_V", "current_A", "speed_rad_per_s", "torque_Nm"))
    time_s, sign = t["t_s"], np.sign(t["speed_rad_per_s"])
    flows, moves = np.abs(current) > 0.1, np.abs(w) > 0.3
    flows[:10] = moves[:10] = flows[-10:] = moves[-10:] = False
    electric = np.column_stack((current, np.sign(current), w, smooth_rate(time_s, current)))
    torque = np.column_stack((current, smooth_rate(time_s, w), sign, w, np.abs(current) * sign))
    inputs = np.column_stack((V, current, w))
    return {"E": (inputs, V, electric, flows), "M": (inputs, T, torque, moves)}


def leg_swing(t):
    """As above; the torque balance is written for the current, since no torque is measured."""
    V, current, q, time_s = t["voltage_V"], t["current_A"], t["hip_angle_rad"], t["t_s"]
    w = smooth_rate(time_s, q, 20)
    sign = np.sign(w)
    flows, moves = np.abs(current) > 0.1, np.abs(w) > 0.1
    flows[:60] = moves[:60] = flows[-60:] = moves[-60:] = False
    electric = np.column_stack((current, np.sign(current), w, smooth_rate(time_s, current)))
    one = np.ones(len(q))
    torque = np.column_stack((smooth_rate(time_s, w, 20), q, np.sin(q), one, sign, w, np.abs(current) * sign))
    inputs = np.column_stack((V, current, w))
    return {"E": (inputs, V, electric, flows), "M": (inputs, current, torque, moves)}


def ankle(t):
    """As above; the current that the board's law asks for, from the angles that are logged. One balance."""
    target, rate, q, time_s = (t[n] for n in ("target_angle_rad", "target_rate_rad_per_s", "joint_angle_rad", "t_s"))
    p = t.get("motor_angle_rad", q)
    w = smooth_rate(time_s, p, 3)
    K, D = t["command_stiffness_A_per_rad"], t["command_dampness_A_s_per_rad"]
    asked = np.clip(K * (target - p) + D * (rate - w), -1.0, 6.0)
    moves = np.abs(w) > 0.3
    moves[:30] = moves[-30:] = False
    torque = np.column_stack((smooth_rate(time_s, w, 3), q, np.ones(len(q)), np.sign(w), w))
    return {"M": (np.column_stack((q, asked, w)), asked, torque, moves)}


def walk(t):
    """As above; the hip's current from its motion, apart for each leg's stance. One balance of many."""
    q, w, current, time_s = (t[n] for n in ("hip_angle_rad", "hip_rate_rad_per_s", "hip_current_A", "t_s"))
    lean, outer = t["outer_leg_rate_rad_per_s"], t["outer_contact"] > 0.5
    parts = (np.gradient(w, time_s), q, np.ones(len(q)), np.sign(w), w, lean)
    rows = np.abs(w) > 0.1
    rows[:30] = rows[-30:] = False
    torque = np.column_stack([part * where for part in parts for where in (outer, ~outer)])
    return {"M": (np.column_stack((q, current, w)), current, torque, rows)}


BALANCES = {"motor-bench": motor_bench, "leg-swing": leg_swing, "ankle": ankle, "walk": walk}


def residuals(files, holdout, experiment):
    """{balance: ((inputs, residual) of the training runs, the same of the held-out ones)}, of the refitted base model.

    Values are means over blocks.
    """
    parts = {}
    for role, paths in (("train", files), ("test", holdout)):
        for path in paths:
            for name, (inputs, target, columns, rows) in BALANCES[experiment](read(path)).items():
                parts.setdefault(name, {}).setdefault(role, []).append((inputs, target, columns, rows))
    out = {}
    for name, roles in parts.items():
        rows = [(columns[rows], target[rows]) for _, target, columns, rows in roles["train"]]
        base = np.linalg.lstsq(np.vstack([c for c, _ in rows]), np.concatenate([y for _, y in rows]), rcond=None)[0]
        both = []
        for role in ("train", "test"):
            x, y = [], []
            for inputs, target, columns, chosen in roles[role]:
                left = (target - columns @ base)[chosen]
                count = len(left) // BLOCK * BLOCK
                y.append(left[:count].reshape(-1, BLOCK).mean(axis=1))
                x.append(inputs[chosen][:count].reshape(-1, BLOCK, inputs.shape[1]).mean(axis=1))
            both.append((np.vstack(x), np.concatenate(y)))
        out[name] = tuple(both)
    return out


def better(left, learned):
    """(standard errors by which the learned residual is better than none, part of the squares that it takes away)."""
    gain = left**2 - (left - learned) ** 2
    spread = np.std(gain) / np.sqrt(len(gain))
    return (float(np.mean(gain) / spread) if spread > 0 else 0.0), float(np.sum(gain) / np.sum(left**2))


def refit_only(files, holdout, experiment):
    """The base model refitted; there is nothing else in its world."""
    residuals(files, holdout, experiment)
    return said(gain=0.0)


def majority_label(files, holdout, experiment):
    """One cause for everything; which one makes no difference where causes are hidden in turn."""
    return said(True, "M", ["stribeck"])


def gaussian_process(files, holdout, experiment):
    """A Gaussian process on the base model's residual; it is held to two halves of the training run."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    def learned(x, y, at):
        scale_x, scale_y = np.std(x, axis=0) + 1e-12, np.std(y)
        kernel = ConstantKernel(0.1) * RBF([1.0] * x.shape[1]) + WhiteKernel(1.0)
        process = GaussianProcessRegressor(kernel, normalize_y=False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a length on its limit: a channel that says nothing
            process.fit(x / scale_x, y / scale_y)
        return process.predict(at / scale_x) * scale_y

    return _learner(files, holdout, experiment, learned)


def sindy(files, holdout, experiment):
    """Sparse regression (SINDy's) of the residual on a library of terms, the strongest of which gives a name."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what its imports say about themselves
        import pysindy

    names = {1: "sensor_offset", 2: "drag", 3: "direction_friction", 4: "contact_drop_change", 5: "stribeck"}

    def library(x):
        V, current, w = x.T
        return np.column_stack(
            (np.ones(len(w)), w * np.abs(w), np.abs(w), current * np.abs(current), w**3, current**3, V * w, V * current)
        )

    chosen = {}

    def learned(x, y, at):
        columns = library(x)
        scale = np.std(columns, axis=0) + 1e-12
        scale[0] = 1.0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns when no term is left
            fit = pysindy.STLSQ(threshold=0.1, alpha=0.01).fit(columns / scale, (y / np.std(y))[:, None])
        weights = np.ravel(fit.coef_)
        chosen["term"] = int(np.argmax(np.abs(weights))) + 1
        return library(at) / scale @ weights * np.std(y)

    answer = _learner(files, holdout, experiment, learned)
    if answer["detected"]:
        answer |= said(True, answer["subsystem"], [names.get(chosen["term"], "drag")], False)
    return answer


def _learner(files, holdout, experiment, learned):
    """Detects by what a learner gains on the half it has not seen; the gain is that on the held-out run."""
    strongest, where, gain = 0.0, None, 0.0
    for name, ((x, y), (x_test, y_test)) in residuals(files, holdout, experiment).items():
        half = len(y) // 2
        sure, _ = better(y[half:], learned(x[:half], y[:half], x[half:]))
        if sure > strongest:
            strongest, where = sure, name
            gain = better(y_test, learned(x, y, x_test))[1]
    found = strongest > LEVEL
    return said(found, where if found else None, (), found, gain if found else None, str(holdout[0]))


def without_balance(diagnose, balance):
    """A diagnosis deaf to one balance, by its answers: where that is all there is to see, it sees nothing.

    For answers that are made up and say their balance; `deaf.py` takes a balance out of the machine itself.
    """

    def deaf(files, holdout, experiment):
        answer = diagnose(files, holdout, experiment)
        causes = [cause for cause in answer["causes"] if cause["balance"] != balance]
        if answer["subsystem"] == balance and not causes:
            return said()
        return answer | {"causes": causes}

    return deaf


NEEDS = {"gaussian_process": ("sklearn", "scikit-learn"), "sindy": ("pysindy", "pysindy")}  # import name, package
COMPARATORS = {f.__name__: f for f in (refit_only, majority_label, gaussian_process, sindy)}

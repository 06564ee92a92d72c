"""How strong an effect is in given data: what of it the base parameters cannot take up, over the noise.

    r       rms, over the run, of that part over the noise's standard deviation at its frequencies; balances are added
            in squares
    N_eff   samples that count: N (1 - rho) / (1 + rho), where rho is the memory of the instruments' noise

A strength of 1 is r = 4.85 / sqrt(N_eff): 90 % detection by a test among 28 candidates. From the truth alone.
"""

import numpy as np

from tests.blind.generator.effects import rate

UNIT = 4.85
FLOWS_A = 0.06  # below it the brushes' drop takes what it must: the voltage balance says nothing


class Scale:
    """Measures effects along one trajectory as given instruments see it."""

    def __init__(self, trajectory, instruments, moves_rad_s):
        t = self.trajectory = trajectory
        self.n_eff = len(t.time_s) * (1.0 - instruments.memory) / (1.0 + instruments.memory)
        self.deviations = instruments.balance_deviations(t.base, len(t.w))
        self.counts = np.array((np.abs(t.I) > FLOWS_A, np.abs(t.w) > moves_rad_s, np.ones(len(t.w))))
        tangent = [self.vector(column) for column in self.sensitivities()]
        self.tangent = np.linalg.qr(np.array(tangent).T)[0]

    def sensitivities(self):
        """Balances' derivatives for R, Vc, L, K, C0, C1, mu, J; of a leg for k_h and m g w too."""
        t, p = self.trajectory, self.trajectory.base
        zero, sign = np.zeros_like(t.w), np.sign(t.w)
        pull = p["G"] * t.I * (1.0 - p["mu"] * np.sign(t.w * t.I))
        q = t.theta / p["G"]
        leg = ((zero, q, zero), (zero, np.cos(q), zero)) if p["mgc"] > 0.0 else ()
        return (
            *leg,
            (t.I, zero, zero),
            (np.sign(t.I), zero, zero),
            (rate(t.I), zero, zero),
            (p["G"] * t.w, -pull, zero),
            (zero, sign, zero),
            (zero, t.w, zero),
            (zero, np.abs(t.I) * sign, zero),
            (zero, t.acceleration, zero),
        )

    def vector(self, balances):
        """Balances over their noise, one after the other."""
        seen = np.fft.rfft(np.array(balances) * self.counts) / self.deviations
        return np.fft.irfft(seen, n=self.counts.shape[1]).ravel()

    def outside(self, balances):
        """What of an effect the base parameters leave."""
        vector = self.vector(balances)
        return vector - self.tangent @ (self.tangent.T @ vector)

    def r(self, balances):
        """rms of what is left over the noise."""
        return float(np.linalg.norm(self.outside(balances))) / np.sqrt(len(self.trajectory.time_s))

    def strength(self, balances):
        """In units of the 90 % detection: sqrt(N_eff) r / 4.85."""
        return self.r(balances) * np.sqrt(self.n_eff) / UNIT

    def shares(self, balances):
        """Part of the strength's square in each balance."""
        squares = np.sum(self.outside(balances).reshape(3, -1) ** 2, axis=1)
        total = max(float(np.sum(squares)), 1e-300)
        return {name: float(value) / total for name, value in zip("EMT", squares, strict=True)}

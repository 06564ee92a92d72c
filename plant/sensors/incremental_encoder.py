# cython: boundscheck=False, wraparound=False
# (indices in the disc's table are taken modulo its size)
"""An incremental encoder: every edge of channel A with the level of channel B, from angle and rate.

Position is counted in edges of A, u = sign x gear x lines / pi x angle: two edges per line, as the 2X decoder
of the firmware counts them. Edge n lies at u = n; A is high from even to odd n, B from n + 1/2 of even n to
n + 1/2 of odd n. So forward, A rises while B is low, which the firmware counts up
(robot.md N4.1).

Between the ends of a step the position is the cubic with the given angles and rates. Where it runs one way
with moderate change of rate, the time of an edge comes from the cubic of the inverse function; otherwise the
cubic is cut at its turning points and each edge found by bisection, so a reversal inside a step gives its edges.

Errors of the disc, all in edges (1 = half a line): `line_error` (standard deviation per line, seeded, fixed for
a disc), `duty_error` (falling edges late by this, so that A's high time is longer), `jitter` (standard deviation
per edge, new every time; it moves the stamp, never past a neighbour or out of the step), and eccentricity of the
disc (rad of encoder shaft, once and twice per turn). `bounce`: share of edges that occur three times, over, back and
over again, as caused by noise at the comparator or in the interpolated position.
"""

from typing import Final

import cython
from cython.cimports.libc.math import cos, sin, sqrt

from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.numbers import reals
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import ModelError

BOUNCE_NS: Final = 3_000  # from over to back: chosen by us, longer than the fast interrupt, so that each edge is seen

PI = 3.141592653589793


@cython.final
@cython.cclass
class IncrementalEncoder:
    """One encoder. `lines` per turn of its shaft; `gear` turns of the shaft per turn of the joint; `sign` of the
    mounting. `edges`: EdgeBuffer of the last `update`; `cell`: edges below the present position, the count
    that a perfect 2X decoder would hold.
    """

    # fields read at every step come first, next to each other
    edges: EdgeBuffer
    calm_rad: cython.double
    calm_from: cython.double
    calm_to: cython.double
    edges_per_rad: cython.double
    edges_at_zero: cython.double
    started: cython.bint
    eccentric: cython.bint
    uneven: cython.bint
    has_errors: cython.bint
    cell: cython.longlong
    total: cython.longlong
    # the running piece
    u0: cython.double
    du: cython.double
    m0: cython.double
    m1: cython.double
    span_ns: cython.double
    t0: cython.longlong
    last_time: cython.longlong
    # description of the encoder
    bounces: cython.longlong
    jitter: cython.double
    bounce: cython.double
    scale: cython.double
    offset_rad: cython.double
    shaft_per_rad: cython.double
    edges_per_shaft_rad: cython.double
    gear: cython.double
    eccentricity_1: cython.double
    phase_1: cython.double
    eccentricity_2: cython.double
    phase_2: cython.double
    lines: cython.longlong
    sign: cython.longlong
    table_size: cython.longlong
    stream: RandomStream
    errors: cython.double[::1]
    name: str
    seed: object

    def __init__(
        self,
        name,
        lines,
        gear=1.0,
        sign=1,
        line_error=0.0,
        duty_error=0.0,
        jitter=0.0,
        bounce=0.0,
        seed=0,
    ) -> None:
        if lines < 1 or gear <= 0.0 or sign not in (-1, 1):
            raise ModelError(f"encoder {name}: {lines} lines, gear {gear}, sign {sign} are impossible")
        self.name = name
        self.lines = lines
        self.gear = gear
        self.sign = sign
        self.shaft_per_rad = sign * gear
        self.edges_per_shaft_rad = lines / PI
        self.scale = 1.0
        self.offset_rad = 0.0
        self.eccentricity_1 = 0.0
        self.phase_1 = 0.0
        self.eccentricity_2 = 0.0
        self.phase_2 = 0.0
        self.jitter = jitter
        self.bounce = bounce
        self.bounces = 0
        self.stream = RandomStream(seed, f"encoder {name} jitter")
        self.table_size = 2 * lines
        self.errors = reals([0.0] * (2 * lines))
        self.has_errors = False
        self.uneven = False  # edges are not where they should be: errors of the disc, or jitter
        self.seed = seed
        self.set_disc(line_error, duty_error)
        self.edges = EdgeBuffer()
        self.cell = 0
        self.total = 0
        self.started = False
        # for a disc without eccentricity, whose edges lie evenly: edges per rad of the joint and at its zero
        self.eccentric = False
        self.edges_per_rad = 0.0
        self.edges_at_zero = 0.0
        # joint angles (rad) between which no edge lies, with `calm_rad` to spare on both sides; 0.0 when unknown
        self.calm_rad = 0.0
        self.calm_from = 0.0
        self.calm_to = 0.0
        # the running piece, as fields so that the helpers need no long argument lists
        self.u0 = 0.0
        self.du = 0.0
        self.m0 = 0.0
        self.m1 = 0.0
        self.t0 = 0
        self.span_ns = 0.0
        self.last_time = 0

    def set_disc(self, line_error, duty_error) -> None:
        """Draw the disc's errors (edges) from the seed; the encoder then has to be reset."""
        if (
            not 0.0 <= line_error <= 0.1
            or not -0.4 <= duty_error <= 0.4
            or self.jitter < 0.0
            or not 0.0 <= self.bounce <= 1.0
        ):
            raise ModelError(
                f"encoder {self.name}: line_error {line_error} (0 ... 0.1), duty_error {duty_error} (-0.4 ... 0.4)"
                f", jitter {self.jitter} (0 or more) or bounce {self.bounce} (0 ... 1) is out of range"
            )
        self.has_errors = line_error > 0.0 or duty_error != 0.0
        disc = RandomStream(self.seed, f"encoder {self.name} disc")
        for line in range(self.lines):
            # clipped at four deviations, so that edges keep their order
            error = line_error * max(-4.0, min(4.0, disc.normal())) if line_error > 0.0 else 0.0
            self.errors[2 * line] = error
            self.errors[2 * line + 1] = error + duty_error
        self.started = False

    @cython.ccall
    @cython.exceptval(check=False)
    def position(self, angle: cython.double) -> cython.double:
        """Position in edges for a joint angle (rad)."""
        shaft: cython.double = self.shaft_per_rad * (self.scale * angle + self.offset_rad)
        if self.eccentricity_1 != 0.0 or self.eccentricity_2 != 0.0:
            shaft += self.eccentricity_1 * sin(shaft + self.phase_1) + self.eccentricity_2 * sin(
                2.0 * shaft + self.phase_2
            )
        return self.edges_per_shaft_rad * shaft

    @cython.ccall
    @cython.exceptval(check=False)
    def speed(self, angle: cython.double, rate: cython.double) -> cython.double:
        """Edges per second at a joint angle and rate."""
        shaft: cython.double
        factor: cython.double = 1.0
        if self.eccentricity_1 != 0.0 or self.eccentricity_2 != 0.0:
            shaft = self.shaft_per_rad * (self.scale * angle + self.offset_rad)
            factor += self.eccentricity_1 * cos(shaft + self.phase_1)
            factor += 2.0 * self.eccentricity_2 * cos(2.0 * shaft + self.phase_2)
        return self.edges_per_shaft_rad * self.shaft_per_rad * self.scale * rate * factor

    @cython.ccall
    @cython.exceptval(check=False)
    def threshold(self, n: cython.longlong) -> cython.double:
        """Where edge n lies, in edges."""
        if self.has_errors:
            return n + self.errors[n % self.table_size]
        return n

    @cython.ccall
    def reset(self, angle: cython.double) -> cython.void:
        """Set the angle without movement: no edges. Needed after a change of the encoder's description."""
        u: cython.double = self.position(angle)
        n: cython.longlong = int(u)
        if u < n:
            n -= 1
        if u >= self.threshold(n + 1):
            n += 1
        elif u < self.threshold(n):
            n -= 1
        self.cell = n
        self.started = True
        self.eccentric = self.eccentricity_1 != 0.0 or self.eccentricity_2 != 0.0
        self.edges_per_rad = self.edges_per_shaft_rad * self.shaft_per_rad * self.scale
        self.edges_at_zero = self.edges_per_shaft_rad * self.shaft_per_rad * self.offset_rad
        self.uneven = self.has_errors or self.jitter > 0.0
        self.calm_rad = 0.0
        self.edges.clear()

    @cython.ccall
    @cython.exceptval(check=False)
    def level_a(self) -> cython.longlong:
        """Level of channel A now."""
        return 1 - (self.cell & 1)

    @cython.ccall
    def level_b(self, angle: cython.double) -> cython.longlong:
        """Level of channel B at an angle (rad): the level A had a quarter of a line earlier."""
        u: cython.double = self.position(angle) - 0.5
        n: cython.longlong = int(u)
        if u < n:
            n -= 1
        return 1 - (n & 1)

    @cython.ccall
    @cython.cdivision(True)  # the divisor is not zero
    def update(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        angle0: cython.double,
        rate0: cython.double,
        angle1: cython.double,
        rate1: cython.double,
    ) -> cython.longlong:
        """All edges of [t0, t1) into `edges`, stamped in ns: joint angles (rad) and rates (rad/s) at both ends.

        Returns their number.
        """
        h: cython.double = (t1 - t0) * 1e-9
        u0: cython.double
        u1: cython.double
        du: cython.double
        m0: cython.double
        m1: cython.double
        g0: cython.double
        g1: cython.double
        b: cython.double
        c: cython.double
        s: cython.double
        x: cython.double
        inverse: cython.double
        span: cython.double
        time: cython.longlong
        last: cython.longlong = t0
        edge: cython.longlong
        end: cython.longlong
        count: cython.longlong
        place: cython.longlong
        levels: cython.longlong  # of A x 2 + of B: each edge changes both
        direction: cython.double = 1.0
        packed: cython.p_longlong
        buffer: EdgeBuffer = self.edges
        buffer.count = 0
        buffer.read = 0
        if self.calm_rad > 0.0 and self.calm_from < angle0 < self.calm_to and self.calm_from < angle1 < self.calm_to:
            # between two edges at both ends; the cubic bulges out by at most 4/27 of each end's rate times the step
            x = rate0 if rate0 > 0.0 else -rate0
            x += rate1 if rate1 > 0.0 else -rate1
            if h * x < self.calm_rad:
                return 0
        if not self.started:
            self.reset(angle0)
        if self.eccentric:
            u0 = self.position(angle0)
            u1 = self.position(angle1)
            m0 = h * self.speed(angle0, rate0)
            m1 = h * self.speed(angle1, rate1)
        else:
            x = self.edges_per_rad
            u0 = x * angle0 + self.edges_at_zero
            u1 = x * angle1 + self.edges_at_zero
            x *= h
            m0 = x * rate0
            m1 = x * rate1
        du = u1 - u0
        g0 = 0.0
        g1 = 0.0
        if m0 * m1 > 0.0:  # the same way at both ends
            g0 = du / m0
            g1 = du / m1
        if g0 < 0.5 or g0 > 2.0 or g1 < 0.5 or g1 > 2.0:
            if m0 != 0.0 or m1 != 0.0 or du != 0.0:
                self._turning(t0, t1, u0, u1, m0, m1)
            return buffer.count
        if self.uneven:
            return self._one_way(t0, t1, u0, u1, g0, g1)
        end = int(u1)
        if u1 < end:
            end -= 1
        edge = self.cell
        # B is low at even edges; A rises there on the way forward, and falls on the way back
        if du > 0.0:
            count = end - edge
            edge += 1
            levels = 1 if edge & 1 else 2
        else:
            count = edge - end
            levels = 3 if edge & 1 else 0
            direction = -1.0
        if count <= 0:
            self._calm()
            return 0
        self.cell = end
        self.total += count
        self.calm_rad = 0.0
        while buffer.capacity < count:  # an angle may have been set from outside
            buffer.grow()
        buffer.count = count
        # ns after t0 at which the fraction s of the way is done: a cubic in s
        inverse = 1.0 / du
        span = t1 - t0
        b = (3.0 - 2.0 * g0 - g1) * span
        c = (g0 + g1 - 2.0) * span
        g0 *= span
        x = edge
        packed = buffer.packed
        for place in range(count):
            s = (x - u0) * inverse
            time = int(s * (g0 + s * (b + s * c)))
            time += t0
            if time < last:
                time = last
            elif time >= t1:
                time = t1 - 1
            last = time
            packed[place] = time << 2 | levels
            levels ^= 3
            x += direction
        return count

    @cython.cfunc
    def _one_way(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        u0: cython.double,
        u1: cython.double,
        g0: cython.double,
        g1: cython.double,
    ) -> cython.longlong:
        """As the end of `update`, for a disc with errors or jitter; `g0`, `g1`: way over speed at both ends."""
        inverse: cython.double = 1.0 / (u1 - u0)
        span: cython.double = t1 - t0
        b: cython.double = (3.0 - 2.0 * g0 - g1) * span
        c: cython.double = (g0 + g1 - 2.0) * span
        jitter: cython.double = self.jitter * span
        s: cython.double
        x: cython.double
        level: cython.double
        time: cython.longlong
        last: cython.longlong = t0
        cell: cython.longlong = self.cell
        count: cython.longlong = 0
        forward: cython.bint = u1 > u0
        buffer: EdgeBuffer = self.edges
        level = self.threshold(cell + 1) if forward else self.threshold(cell)
        if u1 < level if forward else u1 >= level:
            self._calm()
            return 0
        while buffer.capacity < (u1 - cell if forward else cell - u1) + 3.0:  # the errors let in one or two more
            buffer.grow()
        g0 *= span
        while u1 >= level if forward else u1 < level:
            s = (level - u0) * inverse
            x = s * (g0 + s * (b + s * c))
            if jitter > 0.0:
                x += self.stream.normal() * jitter * (inverse if inverse > 0.0 else -inverse)
            time = int(x)
            time += t0
            if time < last:
                time = last
            elif time >= t1:
                time = t1 - 1
            last = time
            if forward:
                cell += 1
                buffer.packed[count] = time << 2 | (1 if cell & 1 else 2)
                level = self.threshold(cell + 1)
            else:
                # back over edge `cell`, where both channels take the same level
                buffer.packed[count] = time << 2 | (3 if cell & 1 else 0)
                cell -= 1
                level = self.threshold(cell)
            count += 1
        self.cell = cell
        self.calm_rad = 0.0
        buffer.count = count
        self.total += count
        return count

    @cython.ccall
    def add_bounces(self, t1: cython.longlong) -> cython.longlong:
        """Let edges of the last `update` bounce, which ended at `t1` (ns); returns how many do.

        An edge without enough time before the next one or the step's end does not bounce.
        """
        buffer: EdgeBuffer = self.edges
        place: cython.longlong = 0
        at: cython.longlong
        edge: cython.longlong
        following: cython.longlong
        count: cython.longlong = 0
        while place < buffer.count:
            edge = buffer.packed[place]
            following = buffer.packed[place + 1] >> 2 if place + 1 < buffer.count else t1
            if self.stream.uniform() < self.bounce and following - (edge >> 2) > 3 * BOUNCE_NS:
                if buffer.capacity < buffer.count + 2:
                    buffer.grow()
                for at in range(buffer.count - 1, place, -1):
                    buffer.packed[at + 2] = buffer.packed[at]
                buffer.packed[place + 1] = (edge ^ 2) + (BOUNCE_NS << 2)
                buffer.packed[place + 2] = edge + (BOUNCE_NS << 3)
                buffer.count += 2
                place += 2
                count += 1
            place += 1
        self.bounces += count
        return count

    @cython.cfunc
    def _calm(self) -> cython.void:
        """Find the joint angles between the two edges around the present position, a tenth of an edge inside."""
        a: cython.double = self.edges_per_rad
        b: cython.double = self.edges_at_zero
        if self.calm_rad > 0.0 or self.eccentric or a == 0.0:
            return
        self.calm_from = (self.threshold(self.cell) + 0.1 - b) / a
        self.calm_to = (self.threshold(self.cell + 1) - 0.1 - b) / a
        if a < 0.0:
            self.calm_from, self.calm_to = self.calm_to, self.calm_from
            a = -a
        self.calm_rad = 0.5 / a  # 4/27 of it are less than a tenth of an edge

    @cython.ccall
    @cython.exceptval(check=False)
    def _value(self, x: cython.double) -> cython.double:
        """The cubic at the fraction x of the step, in edges."""
        return self.u0 + x * (
            self.m0 + x * (3.0 * self.du - 2.0 * self.m0 - self.m1 + x * (self.m0 + self.m1 - 2.0 * self.du))
        )

    @cython.ccall
    def _turning(
        self,
        t0: cython.longlong,
        t1: cython.longlong,
        u0: cython.double,
        u1: cython.double,
        m0: cython.double,
        m1: cython.double,
    ) -> None:
        """Edges of a step in which the position may turn round: pieces between the cubic's turning points."""
        a: cython.double
        b: cython.double
        c: cython.double
        root: cython.double
        x1: cython.double = 1.0
        x2: cython.double = 1.0
        before: cython.longlong = self.edges.count
        self.u0 = u0
        self.du = u1 - u0
        self.m0 = m0
        self.m1 = m1
        self.t0 = t0
        self.span_ns = t1 - t0
        self.last_time = t0
        # derivative: a x^2 + b x + c
        a = 3.0 * (self.m0 + self.m1 - 2.0 * self.du)
        b = 2.0 * (3.0 * self.du - 2.0 * self.m0 - self.m1)
        c = self.m0
        if a == 0.0:
            if b != 0.0:
                x1 = -c / b
        else:
            root = b * b - 4.0 * a * c
            if root > 0.0:
                root = sqrt(root)
                x1 = (-b - root) / (2.0 * a)
                x2 = (-b + root) / (2.0 * a)
                if x1 > x2:
                    x1, x2 = x2, x1
        if not 0.0 < x1 < 1.0:
            x1 = x2
            x2 = 1.0
        if not 0.0 < x1 < 1.0:
            x1 = 1.0
        if not 0.0 < x2 < 1.0:
            x2 = 1.0
        self._piece(0.0, x1)
        if x1 < 1.0:
            self._piece(x1, x2)
        if x2 < 1.0 and x1 < x2:
            self._piece(x2, 1.0)
        self.calm_rad = 0.0
        self.total += self.edges.count - before

    @cython.ccall
    def _piece(self, x0: cython.double, x1: cython.double) -> None:
        """Edges between two fractions of the step in which the cubic runs one way."""
        start: cython.double = self._value(x0)
        end: cython.double = self._value(x1) if x1 < 1.0 else self.u0 + self.du
        if end > start:
            while end >= self.threshold(self.cell + 1):
                self.cell += 1
                self._emit(x0, x1, self.threshold(self.cell), self.cell & 1)
        else:
            while end < self.threshold(self.cell):
                self.cell -= 1
                self._emit(x0, x1, self.threshold(self.cell + 1), (self.cell + 1) & 1)

    @cython.ccall
    def _emit(self, x0: cython.double, x1: cython.double, level: cython.double, level_b: cython.longlong) -> None:
        """One edge where the cubic passes `level` between two fractions of the step (bisection)."""
        low: cython.double = x0
        high: cython.double = x1
        middle: cython.double
        rising: cython.bint = self._value(x1) > self._value(x0)
        time: cython.longlong
        _i: cython.longlong
        for _i in range(40):  # 250 us / 2^40 is far below 1 ns; a fixed number keeps both runs equal
            middle = 0.5 * (low + high)
            if (self._value(middle) < level) == rising:
                low = middle
            else:
                high = middle
        time = self.t0 + int(high * self.span_ns)
        if time < self.last_time:
            time = self.last_time
        if time >= self.t0 + int(self.span_ns):
            time = self.t0 + int(self.span_ns) - 1
        self.last_time = time
        self.edges.push(time, 1 - (self.cell & 1), level_b)

# cython: cdivision=True
# (only by a difference of event functions of opposite sign)
"""A step of the body with the events inside it: located, and acted on where they happen (EQUATIONS 9, 15)."""

import cython

if not cython.compiled:
    from ranger_sim.plant.air import in_air
    from ranger_sim.plant.impact import touch
    from ranger_sim.plant.lift_off import leave, lets_go, may_leave, sole_ready
    from ranger_sim.plant.stance import on_feet
    from ranger_sim.plant.watch import watch


def advance(body, h: cython.double) -> None:
    """Move on by `h` seconds under constant laws of the motors' torques, events located inside (EQUATIONS 15)."""
    remaining: cython.double = h
    used: cython.double
    tries: cython.longlong = 0
    body.elapsed = 0.0
    while remaining > 0.0 and body.mode != 4:
        tries += 1
        if body.mode != 0:  # nothing happens in the operator's hands that a step would be taken back for
            body.save()
        if body.mode == 1 or body.mode == 2:
            on_feet(body, remaining, 4)
            if (body.outer_Fy < 0.0 or body.inner_Fy < 0.0) and tries < 20 and let_pulled_foot_go(body, remaining):
                continue  # a foot left the floor at the start of this piece: nothing has moved yet
        else:
            in_air(body, remaining, 4)
            body.update_pose()
        used = remaining
        if tries < 20 and body.mode != 0 and crossed(body) < 0.0:
            used = locate(body, remaining)
            body.elapsed += used
            act(body)
        else:
            body.elapsed += used
        remaining -= used
    if body.mode == 4:
        body.elapsed = h
    body.time_s += h
    if body.mode != 0 and body.mode != 4:
        watch(body, h)


def let_pulled_foot_go(body, h: cython.double) -> cython.bint:
    """Let a foot go that the floor would have to pull at the start of this piece of `h` seconds.

    True when one was: then the state is that of the start.
    """
    first: cython.longlong
    leg: cython.longlong
    k: cython.longlong
    force: cython.double
    if body.mode == 1:
        if (body.outer_Fy if body.stance == 0 else body.inner_Fy) >= 0.0:
            return False
    elif body.outer_Fy >= 0.0 and body.inner_Fy >= 0.0:
        return False
    body.restore()
    body.update_pose()
    first = 0 if body.outer_Fy < body.inner_Fy else 1
    for k in range(2):
        leg = first if k == 0 else 1 - first
        force = body.outer_Fy if leg == 0 else body.inner_Fy
        if force < 0.0 and may_leave(body, leg) and (sole_ready(body, leg) or lets_go(body, leg)):
            body.update_hip_rates()
            leave(body, leg)
            return True
    on_feet(body, h, 4)
    return False


def crossed(body) -> cython.double:
    """Below 0 when an event lies behind. `event`: 1, 2 outer, inner foot touches; 3, 4 outer, inner foot leaves."""
    value: cython.double = 1.0
    other: cython.double
    body.event = 0
    if body.mode == 2:
        on_feet(body, 0.0, 1)
        if may_leave(body, 0):
            other = body.outer_Fy
            if other >= 0.0 or sole_ready(body, 0) or lets_go(body, 0):
                value = other
                body.event = 3
        if may_leave(body, 1):
            other = body.inner_Fy
            if other < value and (other >= 0.0 or sole_ready(body, 1) or lets_go(body, 1)):
                value = other
                body.event = 4
        return value
    if body.mode == 1:
        if body.stance == 0:
            value = body.gap_inner + (0.0 if body.inner_armed else 2e-6)
        else:
            value = body.gap_outer + (0.0 if body.outer_armed else 2e-6)
        # only a foot ahead can strike; beside and behind it brushes with its sole
        if value < 0.0 and body.ahead() <= body.strike_ahead:
            return 1.0
        body.event = 2 - body.stance  # the other foot
        return value
    body.event = 1
    value = body.gap_outer + (0.0 if body.outer_armed else 2e-6)
    other = body.gap_inner + (0.0 if body.inner_armed else 2e-6)
    if other < value:
        body.event = 2
        return other
    return value


def try_piece(body, h: cython.double) -> cython.double:
    """The event function after a piece of `h` seconds from the saved state."""
    body.restore()
    if body.mode == 1 or body.mode == 2:
        on_feet(body, h, 4)
    else:
        in_air(body, h, 4)
        body.update_pose()
    return crossed(body)


def locate(body, h: cython.double) -> cython.double:
    """Time in (0, h] at which the event function falls through 0, within 1e-10 s (Illinois method)."""
    low: cython.double = 0.0
    high: cython.double = h
    middle: cython.double
    value: cython.double
    f_high: cython.double = crossed(body)
    f_low: cython.double
    side: cython.longlong = 0
    tries: cython.longlong = 0
    body.restore()
    body.update_pose()
    f_low = crossed(body)
    if f_low <= 0.0:
        # already behind at the start: it happens now
        return 0.0
    while high - low > 1e-10 and tries < 60:
        tries += 1
        middle = (low * f_high - high * f_low) / (f_high - f_low)
        if not low < middle < high:
            middle = 0.5 * (low + high)
        value = try_piece(body, middle)
        if value > 0.0:
            low = middle
            f_low = value
            if side == 1:
                f_high *= 0.5
            side = 1
        else:
            high = middle
            f_high = value
            if side == -1:
                f_low *= 0.5
            side = -1
        if value > -1e-13 and value <= 0.0:
            break
    try_piece(body, high)
    return high


def act(body) -> None:
    """Do what the located event asks for."""
    body.update_hip_rates()
    if body.event == 1:
        touch(body, 0)
    elif body.event == 2:
        touch(body, 1)
    elif body.event == 3:
        leave(body, 0)
    elif body.event == 4:
        leave(body, 1)

"""How many examples hypothesis draws.

Two profiles: `ci` always draws the same examples, `thorough` draws others each time, twenty times as many, and keeps
what it finds (`pytest --hypothesis-profile thorough tests/can_bus`). A machine may be busy: no test has a deadline.
"""

from hypothesis import settings

CI, THOROUGH = "ci", "thorough"
UNIT = 100  # as hypothesis itself draws where a test says nothing
TIMES = 20


def register_profiles():
    """Make both known, and `ci` the one that holds unless the command line names another."""
    settings.register_profile(CI, derandomize=True, database=None, deadline=None, max_examples=UNIT)
    settings.register_profile(THOROUGH, deadline=None, max_examples=TIMES * UNIT)
    settings.load_profile(CI)


def examples(count):
    """For `max_examples` of a test that draws `count` in the profile `ci`."""
    return count * settings().max_examples // UNIT

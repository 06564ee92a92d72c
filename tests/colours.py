"""Colours as people see them who have all cones and who lack one kind, and the colours that a page names.

python -m tests.colours '#ffffff' '#1a2129' searches eight colours for lines, for each of these backgrounds, from six
beginnings. The panel's (panel.css) are of such a search, chosen for hues that have names; others are as far apart.
"""

import functools
import itertools
import re
import sys

import numpy as np
from coloraide.everything import ColorAll as Color

from ranger_sim.foundation.random_stream import RandomStream

# Machado, Oliveira and Fernandes 2009, severity 100 %: the cones for red, green or blue light are missing.
SIGHTS = ("normal", "protan", "deutan", "tritan")
SPACE = "cam02-ucs"  # Luo, Cui and Li 2006: equal distances are seen as equal differences


# Of lines one pixel wide a dark or a pale hue is hard to name: they are neither nearly ink nor grey, and lightness
# counts less than hue in the search. Chosen by us, by looking at them; what is found is measured by `closest`.
LEAST_CONTRAST, MOST_CONTRAST = 3.0, 12.0  # WCAG 2.1, 1.4.11: graphics, 3 to 1; to everybody's sight
LEAST_CHROMA = 15.0
LIGHTNESS_COUNTS = 0.7


@functools.cache
def shown(colour):
    """As it looks for each of SIGHTS."""
    full = Color(colour)
    return (full, *(full.filter(sight, 1, method="machado").clip("srgb") for sight in SIGHTS[1:]))


@functools.cache
def seen(colour):
    """Where a colour ("#rrggbb") lies for each of SIGHTS: lightness, towards red, towards yellow, in SPACE."""
    return tuple(tuple(each.convert(SPACE).coords()) for each in shown(colour))


def closest(colours):
    """(distance in SPACE, its two colours, to whose sight) of the two that are most alike."""
    return min(
        (sum((a - b) ** 2 for a, b in zip(here, there, strict=True)) ** 0.5, one, other, sight)
        for one, other in itertools.combinations(colours, 2)
        for sight, here, there in zip(SIGHTS, seen(one), seen(other), strict=True)
    )


def contrast(one, other):
    """By WCAG 2.1: 1 to 21, to the sight to which it is least."""
    return min(here.contrast(there, method="wcag21") for here, there in zip(shown(one), shown(other), strict=True))


def named(style):
    """{"light": {name: "#rrggbb"}, "dark": ...}: the custom properties of a page's style (CSS) that are colours."""
    light, dark = re.findall(r":root \{(.*?)\}", style, re.DOTALL)[:2]
    found = {"light": dict(_properties(light))}
    found["dark"] = found["light"] | dict(_properties(dark))
    for names in found.values():
        for name, value in names.items():
            if other := re.fullmatch(r"var\(--([\w-]+)\)", value):
                names[name] = names[other[1]]
    return {sight: {name: value for name, value in names.items() if value[0] == "#"} for sight, names in found.items()}


def _properties(block):
    return re.findall(r"--([\w-]+):\s*([^;]+?)\s*;", block)


def found(paper, count, seed, tries=200):
    """`count` colours of three digits ("#rgb") for lines on `paper`: those of which the two most alike differ most."""
    names = ["#" + "".join(2 * digit for digit in digits) for digits in itertools.product("0123456789abcdef", repeat=3)]
    names = [name for name in names if LEAST_CONTRAST <= contrast(name, paper) and _hue_is_plain(name, paper)]
    places = np.array([seen(name) for name in names]) * (LIGHTNESS_COUNTS, 1, 1)
    random, best = RandomStream(seed, "colours"), (0.0, [])
    for _ in range(tries):
        least, chosen = _improved(places, [random.integer(len(names)) for _ in range(count)])
        best = max(best, (least, [names[k] for k in chosen]))
    return best[1]


def _hue_is_plain(name, paper):
    _, red, yellow = seen(name)[0]
    return (
        Color(name).contrast(Color(paper), method="wcag21") <= MOST_CONTRAST and np.hypot(red, yellow) >= LEAST_CHROMA
    )


def _improved(places, chosen):
    """(least distance, places) after each was moved away from the others until nothing gets better."""
    away = np.array([_away(places, k) for k in chosen])  # of each chosen one from all there are
    before = -1.0
    while (least := min(away[a, chosen[b]] for a, b in itertools.permutations(range(len(chosen)), 2))) > before:
        before = least
        for k in range(len(chosen)):
            chosen[k] = np.delete(away, k, 0).min(0).argmax()
            away[k] = _away(places, chosen[k])
    return before, chosen


def _away(places, k):
    return np.sqrt(((places - places[k]) ** 2).sum(2)).min(1)


if __name__ == "__main__":
    for paper, seed in itertools.product(sys.argv[1:], range(6)):
        colours = found(paper, 8, seed)
        distance, one, other, sight = closest(colours)
        print(f"{paper}: {' '.join(colours)}; most alike: {one} and {other}, {distance:.1f} apart ({sight})")

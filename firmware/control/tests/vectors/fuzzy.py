#!/usr/bin/env python3
"""Reference vectors of the fuzzy engine: exact rational arithmetic.

Zero-order Takagi-Sugeno with triangular sets, AND = min, weighted mean of
singletons, worked out with fractions. No quantisation of membership, except in
the `chip` vectors, where it is rounded to 0..15 as on the ST52F510.
Standard library only. Run `python3 fuzzy.py` to write fuzzy.json anew.
"""

import json
from fractions import Fraction
from math import floor
from pathlib import Path

VERTICES = [-32767, -16384, -6554, 0, 6554, 16384, 32767]
PD = [
    [-1000, -1000, -600, -300, -150, 0, 100],
    [-1000, -900, -550, -250, 0, 250, 500],
    [-1000, -850, -500, -150, 200, 600, 900],
    [-1000, -800, -400, 0, 400, 800, 1000],
    [-900, -600, -200, 150, 500, 850, 1000],
    [-500, -250, 0, 250, 550, 900, 1000],
    [-100, 0, 150, 300, 600, 1000, 1000],
]
ID = [
    [-1000, -1000, -1000, -1000, -760, -600, -400],
    [-1000, -900, -740, -500, -260, -100, 100],
    [-800, -600, -440, -200, 40, 200, 400],
    [-600, -400, -240, 0, 240, 400, 600],
    [-400, -200, -40, 200, 440, 600, 800],
    [-100, 100, 260, 500, 740, 900, 1000],
    [400, 600, 760, 1000, 1000, 1000, 1000],
]


def fan(vertices):
    """Triangles (vertex, left, right) that reach to the neighbouring vertices."""
    sets = []
    for i, v in enumerate(vertices):
        left = v - vertices[i - 1] if i else 0
        right = vertices[i + 1] - v if i + 1 < len(vertices) else 0
        sets.append((v, left, right))
    return sets


def membership(x, triangle):
    """Exact membership, 0..1; a semi-base of 0 is a vertical side."""
    vertex, left, right = triangle
    distance = x - vertex
    if distance == 0:
        return Fraction(1)
    base = right if distance > 0 else left
    if abs(distance) >= base:
        return Fraction(0)
    return 1 - Fraction(abs(distance), base)


def quantised(mu, levels):
    """Membership level: the fall from full is rounded to nearest, half up."""
    return levels - floor((1 - mu) * levels + Fraction(1, 2))


def weighted_mean(pairs):
    """Sum of weight x singleton over sum of weights; 0 if nothing fires."""
    total = sum(w for w, _ in pairs)
    return Fraction(0) if total == 0 else Fraction(sum(w * y for w, y in pairs)) / total


def grid(x1, x2, sets1, sets2, table, levels=None):
    """Rule table of two inputs; inputs limited to first..last vertex."""
    def levels_of(x, sets):
        x = min(max(x, sets[0][0]), sets[-1][0])
        mus = [membership(x, s) for s in sets]
        return mus if levels is None else [quantised(m, levels) for m in mus]
    a, b = levels_of(x1, sets1), levels_of(x2, sets2)
    return weighted_mean(
        [(min(a[i], b[j]), table[i][j]) for i in range(len(a)) for j in range(len(b))]
    )


def round_away(q):
    """To nearest integer, ties away from zero."""
    return floor(q + Fraction(1, 2)) if q >= 0 else -floor(-q + Fraction(1, 2))


def full_scale(table):
    """Per mille to +-32767, as the firmware stores consequents."""
    return [[round_away(Fraction(y * 32767, 1000)) for y in row] for row in table]


# An 8-bit table in the style of the chip: 5 x 3 sets, 0..15 membership.
CHIP_FIRST = fan([-128, -64, 0, 64, 127])
CHIP_SECOND = fan([-128, 0, 127])
CHIP_TABLE = [[-127, -90, -20], [-100, -50, 10], [-60, 0, 60], [-10, 50, 100], [20, 90, 127]]

# Sets that overlap more than their neighbours, and a flat-sided one: no fan.
WIDE_FIRST = [(-100, 0, 180), (-30, 90, 150), (10, 60, 60), (100, 150, 0)]
WIDE_SECOND = [(-100, 0, 250), (0, 40, 40), (100, 250, 0)]
WIDE_TABLE = [[-9000, -4000, 100], [-7000, 0, 3000], [500, 2500, -800], [1000, 6000, 9000]]

# Three inputs and a list of rules, with inputs left out (None).
LIST_SETS = [fan([-100, 0, 100]), fan([0, 40, 200]), fan([-50, 5, 50])]
LIST_RULES = [
    ((0, 0, None), -1000),
    ((1, None, 1), 250),
    ((2, 1, 2), 900),
    ((None, 2, 0), -333),
    ((2, 2, None), 32767),
    ((0, None, 2), -32768),
]


def rule_list(inputs):
    pairs = []
    for sets, y in LIST_RULES:
        weight = Fraction(1)
        for x, index, triangles in zip(inputs, sets, LIST_SETS):
            if index is not None:
                x = min(max(x, triangles[0][0]), triangles[-1][0])
                weight = min(weight, membership(x, triangles[index]))
        pairs.append((weight, y))
    return weighted_mean(pairs)


def main():
    axis = sorted({-32768, -32767, -32766, -1, 0, 1, 32766, 32767}
                  | {v + d for v in VERTICES for d in (-1, 0, 1) if -32768 <= v + d <= 32767}
                  | set(range(-32000, 32001, 4571)))
    sets = fan(VERTICES)
    out = {}
    for name, table in (("pd", PD), ("id", ID)):
        scaled = full_scale(table)
        out[name] = [[a, b, float(grid(a, b, sets, sets, scaled))] for a in axis for b in axis]
    out["chip"] = [
        [a, b, round_away(grid(a, b, CHIP_FIRST, CHIP_SECOND, CHIP_TABLE, levels=15))]
        for a in range(-128, 128, 5) for b in list(range(-128, 128, 7)) + [127]
    ]
    out["wide"] = [
        [a, b, float(grid(a, b, WIDE_FIRST, WIDE_SECOND, WIDE_TABLE))]
        for a in range(-110, 111, 10) for b in range(-110, 111, 11)
    ]
    out["list"] = [
        [a, b, c, float(rule_list((a, b, c)))]
        for a in range(-110, 111, 20) for b in range(-10, 211, 20) for c in range(-60, 61, 12)
    ]
    Path(__file__).with_suffix(".json").write_text(json.dumps(out) + "\n")


if __name__ == "__main__":
    main()

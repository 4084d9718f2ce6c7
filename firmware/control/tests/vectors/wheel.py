#!/usr/bin/env python3
"""Reference vectors of the wheel: lead filter and profiles, exact fractions.

Filter: MC_n = (K/4) X_n - (A/256)(K/4) X_{n-1} - (B/256) MC_{n-1}, with MC
limited to -128..127 before it is fed back, and no rounding at all.
Profile: each sample takes the largest velocity, found by bisection on the grid of
1/256 count, after which a stop in steps of a, simulated sample by sample, does not
overrun.
Standard library only. Run `python3 wheel.py` to write wheel.json anew.
"""

import json
from fractions import Fraction
from pathlib import Path


class Noise:
    """A small linear congruential generator: the same on every machine."""

    def __init__(self, seed):
        self.state = seed

    def below(self, n):
        self.state = (self.state * 6364136223846793005 + 1442695040888963407) % 2**64
        return (self.state >> 33) % n


def filter_response(a, b, k, errors):
    x_old, mc_old, out = 0, Fraction(0), []
    for x in errors:
        mc = Fraction(k, 4) * x - Fraction(a, 256) * Fraction(k, 4) * x_old - Fraction(b, 256) * mc_old
        mc = min(max(mc, Fraction(-128)), Fraction(127))
        out.append(float(mc))
        x_old, mc_old = x, mc
    return out


def stop_distance(v, a):
    """Way covered by one sample at v and then v - a, v - 2a, ... while positive."""
    way = Fraction(0)
    while v > 0:
        way += v
        v -= a
    return way


def profile(way, v_max, a):
    """Way left after each sample, in counts."""
    left, v, out = Fraction(way), Fraction(0), []
    while left > 0:
        low, high = 0, int(min(v + a, Fraction(v_max)) * 256)
        while low < high:
            middle = (low + high + 1) // 2
            if stop_distance(Fraction(middle, 256), a) <= left:
                low = middle
            else:
                high = middle - 1
        v = Fraction(low, 256)
        left -= v
        out.append(left)
    return out


def nearest(q):
    """To nearest, halves up: q is never negative here."""
    return int((q + Fraction(1, 2)) // 1)


def main():
    noise = Noise(2003)
    filters = []
    cases = [(229, 64, 64), (0, 0, 4), (255, 255, 255), (0, 255, 1), (255, 0, 255),
             (229, 64, 0), (200, 128, 10), (128, 32, 200), (1, 1, 1), (254, 250, 8)]
    for a, b, k in cases:
        small = [noise.below(41) - 20 for _ in range(60)]
        steps = [1] * 8 + [0] * 8 + [1000] * 8 + [-1000] * 8
        edges = [8388607, -8388608, 8388607, 0, -1, 1, -8388608, 8388607, 0, 0, 0]
        errors = small + steps + edges + small
        filters.append({"a": a, "b": b, "k": k, "errors": errors,
                        "commands": filter_response(a, b, k, errors)})
    profiles = []
    for way, v_max, raw in [(1, 127, 32767), (2, 1, 9), (10, 127, 256), (1000, 20, 128),
                            (1000, 127, 77), (5000, 34, 40), (77, 34, 5), (3, 127, 17),
                            (40000, 127, 256), (255, 16, 4096), (256, 16, 4096), (257, 16, 4096),
                            (6001, 60, 333), (128, 127, 32767), (100000, 100, 2000)]:
        left = profile(way, v_max, Fraction(raw, 256))
        points = [way - nearest(q) for q in left]
        kept = points if len(points) <= 400 else points[:: len(points) // 200]
        profiles.append({"way": way, "maximum": v_max, "acceleration_raw": raw,
                         "samples": len(points),
                         "stride": 1 if len(points) <= 400 else len(points) // 200,
                         "points": kept})
    text = json.dumps({"filters": filters, "profiles": profiles})
    Path(__file__).with_suffix(".json").write_text(text + "\n")


if __name__ == "__main__":
    main()

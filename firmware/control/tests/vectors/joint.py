#!/usr/bin/env python3
"""Reference vectors of the joint law: exact rational arithmetic.

The velocity is the least-squares slope computed directly from its definition
over the last N samples; the fuzzy correction comes from fuzzy.py; gains are the
decimal numbers, not their fixed-point images. The measured positions do not
depend on the output (open loop), so errors do not build up.
Standard library only. Run `python3 joint.py` to write joint.json anew.
"""

import json
from fractions import Fraction
from pathlib import Path

from fuzzy import ID, PD, VERTICES, fan, full_scale, grid, round_away
from wheel import Noise

F = Fraction
TICK = F(1, 1000)
GAINS = {
    "kp": F("0.02"), "pd": F("0.6"), "id": F("0.5"), "ff": F("0.003"),
    "error_scale": F(40), "velocity_scale": F(400), "integral_scale": F(1, 4), "zone": F(15),
    "limit": F("0.9"), "dead": F("0.1"), "minimum": F("0.01"),
    "settle": F(1), "settle_velocity": F(20), "settle_ticks": 20,
    "release": F(2), "release_ticks": 3, "window": 16, "fade_ticks": 50,
    "low": F(0), "high": F(180),
}
SETS = fan(VERTICES)
TABLES = {"pd": full_scale(PD), "id": full_scale(ID)}


def slope(samples):
    """Least-squares slope per sample."""
    n = len(samples)
    mean_k = F(n - 1, 2)
    mean_y = sum(samples) / n
    top = sum((k - mean_k) * (y - mean_y) for k, y in enumerate(samples))
    return top / sum((k - mean_k) ** 2 for k in range(n))


def clip(x, low, high):
    return min(max(x, low), high)


class Joint:
    def __init__(self):
        self.kind, self.samples, self.integral = "pd", None, F(0)
        self.settled, self.held = False, 0
        self.last, self.changed, self.bump, self.age = F(0), False, F(0), 0

    def select(self, kind):
        if kind != self.kind:
            self.kind, self.integral, self.changed = kind, F(0), True

    def step(self, measured, reference, reference_velocity):
        g = GAINS
        reference = clip(reference, g["low"], g["high"])
        error = reference - measured
        if self.samples is None:
            self.samples = [measured] * g["window"]
        else:
            self.samples = self.samples[1:] + [measured]
        velocity = slope(self.samples) / TICK
        rate = reference_velocity - velocity

        full = F(32767)
        x2 = round_away(clip(rate / g["velocity_scale"], F(-1), F(1)) * full)
        if self.kind == "pd":
            x1 = round_away(clip(error / g["error_scale"], F(-1), F(1)) * full)
        else:
            x1 = round_away(clip(self.integral / g["integral_scale"], F(-1), F(1)) * full)
        rule = grid(x1, x2, SETS, SETS, TABLES[self.kind]) / 32768
        law = g["kp"] * error + g[self.kind] * rule + g["ff"] * reference_velocity
        if self.changed:
            self.changed, self.bump, self.age = False, self.last - law, 0
        else:
            self.age += 1
        law += self.bump * max(F(0), 1 - F(self.age, g["fade_ticks"]))
        self.last = law

        moves = abs(reference_velocity) > g["settle_velocity"]
        if self.settled:
            change, dwell = abs(error) > g["release"], g["release_ticks"]
        else:
            change = abs(error) <= g["settle"] and abs(velocity) <= g["settle_velocity"] and not moves
            dwell = g["settle_ticks"]
        self.held = self.held + 1 if change else 0
        if (change and self.held >= dwell) or (self.settled and moves):
            self.settled, self.held = not self.settled, 0

        cut = False
        quiet = self.settled or self.held > 0
        if quiet:
            duty, self.bump = F(0), F(0)
        elif abs(law) < g["minimum"]:
            duty = F(0)
        else:
            away = law * error > 0 and abs(error) > g["settle"]
            drives = away or law * reference_velocity > 0
            size = abs(law) + (g["dead"] if drives else 0)
            cut = size > g["limit"]
            duty = min(size, g["limit"]) * (1 if law > 0 else -1)
        if self.kind == "id":
            pushes = cut and error * duty > 0
            if not (quiet or abs(error) > g["zone"] or pushes):
                bound = g["integral_scale"]
                self.integral = clip(self.integral + error * TICK, -bound, bound)
        return duty, velocity


def main():
    """A move, an approach, a rest, a drift out of it, a moving reference, reversals."""
    noise = Noise(45)
    joint, rows, position = Joint(), [], F(20)
    for tick in range(1400):
        if tick == 300:
            joint.select("id")
        if tick == 900:
            joint.select("pd")
        reference = F(60) if tick < 500 else (F(30) if tick < 800 else F(-5))
        if tick >= 1100:
            reference = F(5) + F(tick - 1100, 10)
        reference_velocity = F(100) if tick >= 1100 else F(0)
        target = F(60) if tick < 500 else (F(33) if tick < 800 else F(8))
        if tick >= 1250:
            target = F(20) + F(tick - 1250, 10)
        # A first-order approach on a 1/65536 mm grid, with converter noise.
        position += (target - position) / 40
        if 430 <= tick < 480:
            position += F(1, 10)
        measured_raw = round_away((position + F(noise.below(3) - 1, 23)) * 65536)
        reference_raw = round_away(reference * 65536)
        velocity_raw = round_away(reference_velocity * 65536)
        duty, velocity = joint.step(F(measured_raw, 65536), F(reference_raw, 65536), F(velocity_raw, 65536))
        rows.append([measured_raw, reference_raw, velocity_raw,
                     round(float(duty), 9), round(float(velocity), 6), joint.settled])
        position = F(round_away(position * 65536), 65536)
    text = "[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n"
    Path(__file__).with_suffix(".json").write_text(text)


if __name__ == "__main__":
    main()

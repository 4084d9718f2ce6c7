"""Integrates the bench axis again with scipy and compares it with the simulator.

    wheeleg plant export bench-vq110u --out axis.json
    python check_plant.py axis.json [--tolerance 0.001] [--spoil]

Written from the documented equations, not from the simulator's code: valves
(t_on, t_off, line delay), ISO 6358 flow, polytropic or thermal chambers, laminar
leaks, elasto-plastic friction, end stops, regulator and reservoir. The valves'
edges are found first; between two edges `solve_ivp` integrates with tight
tolerances. Prints the worst difference of each sequence and exits non-zero if one
exceeds 0.1 % of the stroke, or 1 % of the supply's pressure.

With --spoil the independent model is spoilt, one parameter at a time and by a few
percent, and the comparison must fail each time: a check that cannot fail is none.
"""

import argparse
import json
import math
import sys

import numpy as np
from scipy.integrate import solve_ivp


def effect_edges(on_us, t_on, t_off, line):
    """Times [s] at which the chamber sees the valve change, from on-times per tick."""
    coil = []  # (time, level) of the driver
    level = False
    for tick, on in enumerate(on_us):
        start = tick * 1e-3
        if on > 0 and not level:
            coil.append((start, True))
            level = True
        if on < 1000 and level:
            coil.append((start + on * 1e-6, False))
            level = False
    edges, pending, poppet = [], None, False

    def take(until):
        nonlocal pending, poppet
        if pending is not None and pending <= until + 1e-12:
            poppet = not poppet
            edges.append(pending + line)
            pending = None

    for time, wanted in coil:
        take(time)
        if wanted == poppet:
            pending = None  # called back before it moved
        else:
            pending = time + (t_on if wanted else t_off)
    take(math.inf)
    return edges


def series(up, down):
    """Two ISO 6358 paths in series (ISO 6358-3): C by the choked pair, b by small drops."""
    c1, b1 = up["conductance_m3_s_pa"], up["critical_ratio"]
    c2, b2 = down["conductance_m3_s_pa"], down["critical_ratio"]

    def excess(r):  # upstream flow minus what chokes the downstream path at ratio r
        psi = 1.0 if r <= b1 else math.sqrt(max(0.0, 1 - ((r - b1) / (1 - b1)) ** 2))
        return c1 * psi - c2 * r

    low, high = 0.0, 1.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    c = min(c1, c2 * low) if low > b1 else c1
    b = 1 - c * c * ((1 - b1) / c1**2 + (1 - b2) / c2**2)
    return {**up, "conductance_m3_s_pa": c, "critical_ratio": min(max(b, 0.0), 0.9)}


class Axis:
    def __init__(self, p):
        self.p, self.gas, self.cyl, self.sup = p, p["gas"], p["cylinder"], p["supply"]
        c = self.cyl
        self.area_a = math.pi / 4 * c["bore_m"] ** 2
        self.area_rod = math.pi / 4 * c["rod_m"] ** 2
        self.area_b = self.area_a - self.area_rod
        line = c["line_flow"]
        fill, vent = c["fill_valve"]["flow"], c["vent_valve"]["flow"]
        self.fill = series(fill, line) if line else fill
        self.vent = series(line, vent) if line else vent
        model = c["gas_model"]
        self.thermal = model["kind"] == "thermal"
        self.n = self.gas["heat_capacity_ratio"] if self.thermal else model["exponent"]
        self.h = model.get("heat_transfer_w_m2_k", 0.0)

    def flow(self, path, p1, t1, p2, t2):
        if p1 < p2:
            return -self.flow(path, p2, t2, p1, t1)
        g = self.gas
        r, b, beta = p2 / p1, path["critical_ratio"], path["linear_ratio"]
        m = path["subsonic_exponent"]

        def psi(x):
            return 1.0 if x <= b else (1 - ((x - b) / (1 - b)) ** 2) ** m

        share = psi(r) if r <= beta else psi(beta) * (1 - r) / (1 - beta)
        scale = path["conductance_m3_s_pa"] * g["reference_density_kg_m3"]
        return scale * p1 * share * math.sqrt(g["reference_temperature_k"] / t1)

    def friction(self, z, v, pa, pb):
        f = self.cyl["friction"]
        grown = 1.0
        if f["pressure_area_m2"] > 0 and f["coulomb_n"] > 0:
            gauge = max(pa, pb) - self.gas["ambient_pressure_pa"]
            grown += f["pressure_area_m2"] * max(gauge, 0.0) / f["coulomb_n"]
        fc, fs = f["coulomb_n"] * grown, f["static_n"] * grown
        s0 = f["bristle_stiffness_n_m"] * grown
        g = fc + (fs - fc) / (1 + (v / f["stribeck_m_s"]) ** 2)
        share = z * s0 / g
        depth = (abs(share) - f["elastic_share"]) / (1 - f["elastic_share"])
        if depth <= 0 or share * v <= 0:
            alpha = 0.0
        else:
            x = min(depth, 1.0)
            alpha = x * x * (3 - 2 * x)
        rate = v * (1 - alpha * abs(share))
        force = s0 * z + f["bristle_damping_n_s_m"] * rate + f["viscous_n_s_m"] * v
        return force, rate

    def stop(self, x, v):
        e = self.cyl["end_stop"]

        def side(depth, rate):
            force = 0.0
            if depth > 0:
                force = max(0.0, e["stiffness_n_m"] * depth * (1 + e["damping_s_m"] * rate))
            if rate > 0 and e["cushion_length_m"] > 0:
                share = min(1 + depth / e["cushion_length_m"], 1.0)
                force += e["cushion_damping_n_s_m"] * max(share, 0.0) * rate
            return force

        return side(-x, -v) - side(x - self.cyl["stroke_m"], v)

    def volumes(self, x):
        c = self.cyl
        return (
            c["dead_volume_a_m3"] + c["line_volume_m3"] + self.area_a * x,
            c["dead_volume_b_m3"] + c["line_volume_m3"] + self.area_b * (c["stroke_m"] - x),
        )

    def rates(self, _, y, opened, load):
        x, v, z, ya, yb, ma, mb, supply_kg = y
        g, c = self.gas, self.cyl
        r, ambient, t0 = g["gas_constant_j_kg_k"], g["ambient_pressure_pa"], g["ambient_temperature_k"]
        va, vb = self.volumes(x)
        pa, pb = ya / va, yb / vb
        ta, tb = (ya / (ma * r), yb / (mb * r)) if self.thermal else (t0, t0)
        ps = supply_kg * r * t0 / self.sup["reservoir_m3"]
        dy, dm, taken = [0.0, 0.0], [0.0, 0.0], 0.0

        def into(i, flow, t_up):
            dm[i] += flow
            dy[i] += self.n * r * t_up * flow

        for i, (p, t) in enumerate(((pa, ta), (pb, tb))):
            if opened[2 * i]:
                flow = self.flow(self.fill, ps, t0, p, t)
                into(i, flow, t0 if flow >= 0 else t)
                taken += flow
            if opened[2 * i + 1]:
                flow = self.flow(self.vent, p, t, ambient, t0)
                into(i, -flow, t if flow >= 0 else t0)
        leak = g["reference_density_kg_m3"] / (2 * g["reference_pressure_pa"])
        piston = leak * c["piston_leak_m3_s_pa"] * (pa * pa - pb * pb)
        rod = leak * c["rod_leak_m3_s_pa"] * (pb * pb - ambient * ambient)
        t_up = ta if piston >= 0 else tb
        into(0, -piston, t_up)
        into(1, piston, t_up)
        into(1, -rod, tb if rod >= 0 else t0)
        if self.thermal:
            wall = c["dead_wall_area_m2"] + 2 * self.area_a
            side = math.pi * c["bore_m"]
            dy[0] += (self.n - 1) * self.h * (wall + side * x) * (t0 - ta)
            dy[1] += (self.n - 1) * self.h * (wall + side * (c["stroke_m"] - x)) * (t0 - tb)
        dy[0] -= (self.n - 1) * pa * self.area_a * v
        dy[1] += (self.n - 1) * pb * self.area_b * v
        drag, dz = self.friction(z, v, pa, pb)
        push = pa * self.area_a - pb * self.area_b - ambient * self.area_rod
        force = push - drag + self.stop(x, v) + load
        s = self.sup
        opening = min(max((s["set_pressure_pa"] - ps) / s["droop_pa"], 0.0), 1.0)
        source = 0.0
        if opening > 0 and s["source_pressure_pa"] > ps:
            source = opening * self.flow(s["regulator_flow"], s["source_pressure_pa"], t0, ps, t0)
        acceleration = force / self.p["moving_mass_kg"]
        return [v, acceleration, dz, dy[0], dy[1], dm[0], dm[1], source - taken]

    def run(self, case):
        c, g = self.cyl, self.gas
        on = np.array(case["on_us"])
        edges = []
        for i in range(4):
            valve = c["fill_valve"] if i % 2 == 0 else c["vent_valve"]
            spread = c["timing_spread"][i]
            for time in effect_edges(on[:, i], valve["t_on_s"] * spread, valve["t_off_s"] * spread, c["line_delay_s"]):
                edges.append((time, i))
        edges.sort()
        rt = g["gas_constant_j_kg_k"] * g["ambient_temperature_k"]
        x0 = case["start"]["stroke_m"]
        va, vb = self.volumes(x0)
        pa, pb = case["start"]["pressure_pa"]
        supply = self.sup["initial_pressure_pa"] * self.sup["reservoir_m3"] / rt
        y = np.array([x0, 0, 0, pa * va, pb * vb, pa * va / rt, pb * vb / rt, supply])
        end = len(on) * 1e-3
        opened, now, grid, out = [False] * 4, 0.0, np.arange(len(on)) * 1e-3, []
        atol = [1e-10, 1e-8, 1e-12, 1e-8, 1e-8, 1e-14, 1e-14, 1e-12]
        for time, valve in [*edges, (end, None)]:
            time = min(time, end)
            if time > now:
                inside = grid[(grid >= now - 1e-12) & (grid < time - 1e-12)]
                solution = solve_ivp(self.rates, (now, time), y, method="LSODA", rtol=1e-8, atol=atol,
                                     t_eval=np.append(inside, time), args=(opened, self.p["load_n"]), max_step=1e-3)
                if not solution.success:
                    raise RuntimeError(solution.message)
                for k in range(len(inside)):
                    row = solution.y[:, k]
                    wa, wb = self.volumes(row[0])
                    out.append((row[0], row[3] / wa, row[4] / wb))
                y, now = solution.y[:, -1], time
            if valve is not None:
                opened[valve] = not opened[valve]
        return np.array(out)


def compare(axis, case, tolerance):
    """Worst differences of stroke (of the stroke) and pressure (of the supply), travel, verdict."""
    ours, theirs = axis.run(case), np.array(case["rows"])
    if ours.shape != theirs.shape:
        raise SystemExit(f"{case['name']}: {ours.shape} rows against {theirs.shape}")
    stroke, supply = axis.cyl["stroke_m"], axis.sup["set_pressure_pa"]
    x = np.abs(ours[:, 0] - theirs[:, 0]).max() / stroke
    p = np.abs(ours[:, 1:] - theirs[:, 1:]).max() / supply
    travel = np.ptp(theirs[:, 0]) / stroke
    return x, p, travel, x <= tolerance and p <= 10 * tolerance and travel > 0.05


# Part of the parameters, field, factor: each moves a trajectory by more than the tolerance.
SPOILT = [
    (("cylinder", "vent_valve", "flow"), "conductance_m3_s_pa", 1.02),
    (("cylinder", "fill_valve", "flow"), "critical_ratio", 1.15),
    (("cylinder", "fill_valve"), "t_on_s", 1.2),
    (("cylinder",), "dead_volume_a_m3", 1.5),
    (("cylinder", "friction"), "coulomb_n", 1.1),
    ((), "moving_mass_kg", 1.5),
]


def spoil(data, tolerance):
    """Names of the spoilt parameters that nothing shows."""
    unseen = []
    plant = data["plants"][0]
    for path, field, factor in SPOILT:
        parameters = json.loads(json.dumps(plant["parameters"]))
        part = parameters
        for name in path:
            part = part[name]
        part[field] *= factor
        axis = Axis(parameters)
        seen = next((c["name"] for c in plant["cases"] if not compare(axis, c, tolerance)[3]), None)
        print(f"{field} x {factor}: {'shows in ' + seen if seen else 'NOT SEEN'}")
        if seen is None:
            unseen.append(field)
    return unseen


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file")
    parser.add_argument("--tolerance", type=float, default=1e-3, help="of the stroke")
    parser.add_argument("--spoil", action="store_true", help="spoil the independent model: it must show")
    args = parser.parse_args()
    with open(args.file, encoding="utf-8") as file:
        data = json.load(file)
    if args.spoil:
        return int(bool(spoil(data, args.tolerance)))
    failed = False
    for plant in data["plants"]:
        axis = Axis(plant["parameters"])
        for case in plant["cases"]:
            x, p, travel, good = compare(axis, case, args.tolerance)
            failed |= not good
            name = f"{plant['name']}, {case['name']}"
            verdict = "ok" if good else "FAIL"
            print(f"{name:40} stroke {100 * x:.4f} %  pressure {100 * p:.3f} %  travel {100 * travel:.0f} %  {verdict}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())

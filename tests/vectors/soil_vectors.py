"""Reference values of wheels, plates and nails in soft soil.

    python3 soil_vectors.py > soil.json

Independent of the simulator: written from the equations of docs/reference/soils.md, integrated with
Simpson's rule over 2001 nodes on either side of the pressure's peak, where the simulator has four
and five nodes of Gauss and Legendre and then a table. Values are rounded to nine digits, far
inside of what Simpson's rule is off by, so that the file is the same on every machine.
"""

import json
import math

import numpy as np
from scipy.integrate import simpson
from scipy.optimize import brentq

NODES = 2001
GRAVITY = 9.81

# kc, kphi, n, cohesion, friction [degrees], K, density
SOILS = {
    "volcanic-sand": (0.0, 3.0e6, 1.1, 300.0, 36.0, 0.010, 1500.0),
    "dry-sand": (0.99e3, 1.528e6, 1.1, 1040.0, 28.0, 0.025, 1500.0),
    "firm-sand": (102e3, 5.301e6, 0.793, 1300.0, 31.1, 0.012, 1600.0),
    "loose-ash": (0.0, 0.5e6, 1.1, 200.0, 34.0, 0.025, 1100.0),
}
# radius, width, lug
WHEELS = {"field": (0.15, 0.10, 0.015), "smooth": (0.15, 0.05, 0.0)}
SINKAGES = (0.0005, 0.002, 0.007, 0.0167, 0.03, 0.05, 0.08)
SLIPS = (-3.0, -1.0, -0.4, -0.1, 0.0, 0.03, 0.1, 0.2, 0.3, 0.5, 0.8, 1.0)
LOAD = 107.0


def wheel(soil, size, z, s):
    """Normal force, compaction resistance, thrust, torque."""
    kc, kphi, n, c, degrees, shear, _ = SOILS[soil]
    r, b, lug = size
    mu, k, outer = math.tan(math.radians(degrees)), kc / b + kphi, r + lug
    entry = math.acos(1 - z / r)
    skid = s if s >= 0 else s / (s - 1)
    peak = (0.4 + 0.2 * skid) * entry
    total = np.zeros(4)
    for start, end, front in ((0.0, peak, False), (peak, entry, True)):
        theta = np.linspace(start, end, NODES)
        alike = theta if front else entry - theta / peak * (entry - peak)
        sigma = k * np.maximum(r * (np.cos(alike) - math.cos(entry)), 0.0) ** n
        j = outer * ((entry - theta) - (1 - s) * (math.sin(entry) - np.sin(theta)))
        tau = (c + sigma * mu) * (1 - np.exp(-np.abs(j) / shear)) * np.sign(j)
        total += [
            simpson(f, x=theta)
            for f in (
                sigma * np.cos(theta) + tau * np.sin(theta),
                sigma * np.sin(theta),
                tau * np.cos(theta),
                tau,
            )
        ]
    n_, compaction, thrust, along = r * b * total
    return n_, compaction, thrust, outer * along


def under_load(soil, size, s):
    """Slip, sinkage, drawbar pull, torque at the load."""
    z = brentq(lambda z: wheel(soil, size, z, s)[0] - LOAD, 1e-6, 0.12, xtol=1e-15)
    _, compaction, thrust, torque = wheel(soil, size, z, s)
    return s, z, thrust - compaction, torque


def plate(soil, diameter, load):
    """Sinkage of a flat round plate."""
    kc, kphi, n = SOILS[soil][:3]
    radius = diameter / 2
    pressure = load / (math.pi * radius**2)
    return (pressure / (kc / radius + kphi)) ** (1 / n)


def nails(soil, count, diameter, load):
    """Depth of the tips and lateral limit."""
    degrees, density = SOILS[soil][4], SOILS[soil][6]
    mu = math.tan(math.radians(degrees))
    scale = density * GRAVITY * (894 * mu**3 - 386 * mu**2 + 89 * mu)
    depth = load / (count * 0.5 * scale * math.pi * diameter**2 / 4)
    return depth, count * 0.377 * scale * diameter * depth**2 / 2


def digits(values):
    return [float(f"{value:.9g}") for value in values]


def main():
    wheels = []
    for soil in SOILS:
        for size in WHEELS.values():
            cases = [digits((z, s, *wheel(soil, size, z, s))) for z in SINKAGES for s in SLIPS]
            loaded = [digits(under_load(soil, size, s)) for s in SLIPS if s >= 0]
            wheels.append(
                {"soil": soil, "radius_width_lug_m": size, "cases": cases, "under_107_n": loaded}
            )
    flat = [
        {"soil": soil, "diameter_m": d, "load_n": 16.0, "sinkage_m": digits([plate(soil, d, 16.0)])[0]}
        for soil in SOILS
        for d in (0.12, 0.06)
    ]
    pins = []
    for soil in SOILS:
        for load in (3.0, 6.0):
            depth, most = digits(nails(soil, 6, 0.004, load))
            pins.append({"soil": soil, "count": 6, "diameter_m": 0.004, "load_n": load,
                         "depth_m": depth, "lateral_n": most})
    lists = {"wheels": wheels, "plates": flat, "nails": pins}
    # A case a line.
    print(json.dumps(lists, separators=(",", ":")).replace(",[", ",\n[").replace(",{", ",\n{"))


if __name__ == "__main__":
    main()

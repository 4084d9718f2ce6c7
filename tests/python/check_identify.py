"""`wheeleg identify` against SciPy's least_squares: the same cost within 1 %.

The residuals are written anew here, over the Python package's plant, so that neither the optimiser nor
what it is given is shared with the program.

usage: check_identify.py WHEELEG FOLDER
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import wheeleg

AXIS = "bench-vq110u"
TICKS = 3400
# Share of the measurement that the program fits, of its default.
FITTED = 0.7
PRESSURE_PA = 2e3
# What is not known of the measurement itself (decision 52), as standard deviations: zero of the sensor, stroke
# and pressures at the start beside the mean at rest, in m and Pa. Within 10 of them.
UNKNOWNS = np.array([1e-4, 1e-3, 1e4, 1e4])
UNKNOWN_MOST = 10.0
# Two-sided 95 % of a normal distribution, in standard deviations.
Z95 = 1.959964
# By parameter: the factor within which the file is trusted 19 times of 20 (decision 52), and the paths of
# the axis file, as `wheeleg identify` has them: it says so in its summary, compared below.
PARAMETERS = {
    "fill_conductance": (3.0, ["fill_valve.conductance"]),
    "vent_conductance": (3.0, ["vent_valve.conductance"]),
    "critical_ratio": (1.6, ["fill_valve.critical_ratio", "vent_valve.critical_ratio"]),
    "opening_delay": (3.0, ["fill_valve.t_on", "vent_valve.t_on"]),
    "closing_delay": (3.0, ["fill_valve.t_off", "vent_valve.t_off"]),
    "dead_volume_a": (5.0, ["cylinder.dead_volume_a"]),
    "dead_volume_b": (5.0, ["cylinder.dead_volume_b"]),
    "friction": (3.0, ["friction.coulomb", "friction.static"]),
    "viscous_friction": (5.0, ["friction.viscous"]),
    "mass": (3.0, ["moving.mass"]),
    "supply_pressure": (1.3, ["supply.set_pressure", "supply.initial_pressure"]),
    "exponent": (1.15, ["cylinder.exponent"]),
}


def valves():
    """A rest, strokes of two lengths, pulses, and chambers by themselves: on-times in µs."""
    out, back = [1000, 0, 0, 1000], [0, 1000, 1000, 0]
    on_us = np.zeros((TICKS, 4), dtype=np.uint16)
    for begin, length, what in (
        (200, 300, out),
        (600, 300, back),
        (1000, 80, out),
        (1250, 60, back),
        (1500, 150, [1000, 0, 1000, 0]),
        (1800, 120, [0, 0, 0, 1000]),
        (2050, 100, [0, 1000, 0, 0]),
        (2300, 200, out),
        (2700, 300, back),
        (3100, 90, out),
    ):
        on_us[begin : begin + length] = what
    return on_us


def played(axis, on_us):
    """Stroke and both pressures before each tick, as a bench samples them: TICKS x 3."""
    cylinder = wheeleg.Cylinder(axis, seed=0)
    names = ("stroke_m", "pressure_a_pa", "pressure_b_pa")
    first = cylinder.outputs()
    rows = cylinder.run(on_us)
    columns = [np.concatenate(([first[name]], rows[name][:-1])) for name in names]
    return np.stack(columns, axis=1)


def changed(axis, paths, logs, start=None):
    """The axis with factors on its parameters."""
    parameters = axis.parameters()
    values = {}
    for at, log in zip(paths, logs):
        for path in at:
            parameter = parameters[path]
            values[path] = f"{float(parameter['value'] * np.exp(log))!r} {parameter['unit']}"
    if start is not None:
        values["start.stroke"] = f"{float(start[0] * 1e3)!r} mm"
        values["start.pressure_a"] = f"{float(start[1])!r} Pa"
        values["start.pressure_b"] = f"{float(start[2])!r} Pa"
    return axis.with_values(values)


def bounds(axis, paths):
    """Logarithms of the least and the largest factor that the file's ranges allow, by parameter."""
    parameters = axis.parameters()
    least, largest = [], []
    for at in paths:
        rows = [parameters[path] for path in at]
        least.append(max(np.log(max(row["min"], 1e-9) / row["value"]) for row in rows))
        largest.append(min(np.log(row["max"] / row["value"]) for row in rows))
    # Not onto the ends, where rounding may leave them.
    return np.array(least) + 1e-6, np.array(largest) - 1e-6


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    axis, on_us, random = wheeleg.Axis(AXIS), valves(), np.random.default_rng(5)
    # The sensor's noise: uniform within a bound in each of the conversions that are averaged, and the
    # converter's steps.
    sensor = {name: axis.parameters()[f"sensor.{name}"]["value"] for name in (
        "potentiometer.electrical_stroke", "adc.bits", "adc.oversampling", "adc.noise")}
    lsb_m = sensor["potentiometer.electrical_stroke"] * 1e-3 / 2 ** sensor["adc.bits"]
    noise_m = lsb_m * np.sqrt(sensor["adc.noise"] ** 2 / 3 / sensor["adc.oversampling"] + 1 / 12)
    scale = np.array([noise_m, PRESSURE_PA, PRESSURE_PA])

    names = list(PARAMETERS)
    at = [paths for _, paths in PARAMETERS.values()]
    trust = np.log([factor for factor, _ in PARAMETERS.values()]) / Z95
    truth = 0.4 * trust * random.uniform(-1, 1, len(names))
    measured = played(changed(axis, at, truth), on_us) + random.normal(0, scale, (TICKS, 3))

    lab = folder / "lab.csv"
    columns = "time_s,position_mm,fill_a_us,vent_a_us,fill_b_us,vent_b_us,pressure_a_bar,pressure_b_bar"
    with lab.open("w") as file:
        file.write(columns + "\n")
        for tick, (row, on) in enumerate(zip(measured.tolist(), on_us.tolist())):
            position_m, *pressures_pa = row
            cells = [f"{tick * 1e-3:.3f}", position_m * 1e3, *on, *(p * 1e-5 for p in pressures_pa)]
            file.write(",".join(map(str, cells)) + "\n")
    run = subprocess.run(
        [program, "identify", str(lab), "--axis", AXIS, "--out", str(folder / "run")],
        capture_output=True,
        text=True,
    )
    assert run.returncode in (0, 1), run.stderr
    summary = json.loads((folder / "run" / "summary.json").read_text())
    found = {parameter["name"]: parameter for parameter in summary["parameters"]}
    assert [found[name]["paths"] for name in names] == at, found
    ours = np.log([found[name]["factor"] for name in names])

    still = int(np.argmax(on_us.any(axis=1)))
    start = measured[: still + 1].mean(axis=0)
    fitted = round(TICKS * FITTED)

    most_m = axis.parameters()["cylinder.stroke"]
    most_m = most_m["value"] * {"mm": 1e-3, "m": 1.0}[most_m["unit"]]
    count = len(names)

    def residuals(logs, unknowns):
        zero_m, stroke_m, *pressures_pa = unknowns * UNKNOWNS
        begin = start + np.array([stroke_m - zero_m, *pressures_pa])
        begin[0] = np.clip(begin[0], 0.0, most_m)
        model = played(changed(axis, at, logs, begin), on_us)[:fitted]
        model[:, 0] += zero_m
        data = ((model - measured[:fitted]) / scale).ravel()
        return np.concatenate((data, logs / trust, unknowns))

    def least(logs):
        """The least cost with these factors: the program does not report the unknowns."""
        return least_squares(lambda unknowns: residuals(logs, unknowns), np.zeros(4), diff_step=2e-3).cost

    starts = [np.zeros(count), *(trust * random.uniform(-1, 1, (2, count)))]
    limits = [np.append(end, np.full(4, most)) for end, most in zip(bounds(axis, at), (-UNKNOWN_MOST, UNKNOWN_MOST))]
    fits = [
        least_squares(
            lambda x: residuals(x[:count], x[count:]),
            np.append(begin, np.zeros(4)),
            bounds=limits,
            diff_step=2e-3,
            xtol=1e-6,
            ftol=1e-6,
            max_nfev=40,
        )
        for begin in starts
    ]
    best = min(fits, key=lambda fit: fit.cost)
    found = least(ours)
    ratio = found / best.cost
    worst = np.max(np.abs(ours - best.x[:count]) / trust)
    print(
        f"identify: cost {found:.1f}, SciPy's least {best.cost:.1f} (ratio {ratio:.4f}); "
        f"factors at most {worst:.3f} of the file's trust apart; the truth costs {least(truth):.1f}"
    )
    # Beyond 1 % either way one of the two has stopped elsewhere.
    assert abs(ratio - 1.0) <= 0.01, ratio


main()

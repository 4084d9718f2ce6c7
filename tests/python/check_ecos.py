"""Mock-up units in Ecos, a co-simulation engine in C++ that knows nothing of FMPy: they run, and give the bits of
the Python package.

usage: check_ecos.py WHEELEG LIBRARY FOLDER
"""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure
from ecospy.EcosParameterSet import EcosParameterSet

import wheeleg

AXIS = "bench-vq110u"
SEED = 11
TICKS = 1500
VALVES = ["fill_a_us", "vent_a_us", "fill_b_us", "vent_b_us"]
SEEN = ["stroke_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa"]


def export(program, library, folder, kind):
    path = folder / f"{kind}.fmu"
    subprocess.run(
        [program, "export", "fmu", AXIS, "--kind", kind, "--fmi", "2", "--library", library, "--out", path],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return path


def valves(tick):
    """On-times of the four valves, µs: out, rest, back."""
    if tick < 300:
        return [1000, 0, 0, 1000]
    return [0, 0, 0, 0] if tick < 600 else [0, 1000, 1000, 0]


def played(archive, mass_kg, inputs):
    """Outputs after each tick, with the inputs of each: TICKS x 4."""
    with EcosSimulationStructure() as structure, EcosParameterSet() as parameters:
        structure.add_model("axis", archive)
        parameters.add_int("axis::seed", SEED)
        if mass_kg is not None:
            parameters.add_real("axis::moving.mass", mass_kg)
        structure.add_parameter_set("start", parameters)
        with EcosSimulation(structure=structure, step_size=1e-3) as simulation:
            simulation.init(parameter_set="start")
            rows = []
            for tick in range(TICKS):
                for name, value in inputs(tick).items():
                    simulation.set_real(f"axis::{name}", float(value))
                simulation.step()
                rows.append([simulation.get_real(f"axis::{name}") for name in SEEN])
            simulation.terminate()
    return np.array(rows)


def main():
    program, library, folder = sys.argv[1], sys.argv[2], Path(sys.argv[3])
    EcosLib.set_log_level("warn")
    load_n = np.where(np.arange(TICKS) < 700, -8.0, 3.0)
    found = played(
        export(program, library, folder, "plant"),
        2.5,
        lambda tick: dict(zip(VALVES, valves(tick)), load_n=load_n[tick]),
    )
    axis = wheeleg.Axis(AXIS).with_values({"moving.mass": "2.5 kg"})
    expected = wheeleg.Cylinder(axis, seed=SEED).run(np.array([valves(k) for k in range(TICKS)]), load_n=load_n)
    for column, name in enumerate(SEEN):
        np.testing.assert_array_equal(found[:, column], expected[name], err_msg=name)
    assert np.ptp(found[:, 0]) > 0.1

    reference_m = np.where(np.arange(TICKS + 1) < 700, 0.12, 0.05)
    found = played(
        export(program, library, folder, "controlled"), None, lambda tick: {"reference_m": reference_m[tick]}
    )
    expected = wheeleg.AxisSim(AXIS, seed=SEED).run(reference_m)
    for column, name in enumerate(SEEN):
        # The package's row is of a tick's start, the unit's outputs are of its end.
        np.testing.assert_array_equal(found[:, column], expected[name][1:], err_msg=name)
    assert abs(found[-1, 0] - 0.05) < 1e-3, found[-1]
    print(
        f"ecos: ecospy {version('ecospy')}: plant and controlled units of FMI 2.0, {TICKS} steps each, "
        f"{2 * len(SEEN) * TICKS} outputs equal those of the package to the bit"
    )


main()

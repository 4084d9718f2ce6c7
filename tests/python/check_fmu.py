"""Functional Mock-up Units in FMPy: valid, and equal to the Python package bit for bit.

usage: check_fmu.py WHEELEG LIBRARY FOLDER
"""

import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import wheeleg

AXIS = "bench-vq110u"
SEED = 11
TICKS = 1500


class Slave:
    """An instance of either version, with one set of names."""

    def __init__(self, archive, folder, messages):
        description = fmpy.read_model_description(archive)
        unpacked = fmpy.extract(archive, str(folder))
        self.v3 = description.fmiVersion == "3.0"
        self.variables = {v.name: v for v in description.modelVariables}
        make = FMU3Slave if self.v3 else FMU2Slave
        self.fmu = make(
            guid=description.guid,
            unzipDirectory=unpacked,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one %s %n",
        )
        if self.v3:
            def log(environment, status, category, message):
                messages.append(message.decode())

            self.fmu.instantiate(logMessage=log)
        else:
            # FMPy's own callbacks print; errors are seen as exceptions.
            self.fmu.instantiate()
            self.fmu.setupExperiment(startTime=0.0)

    def start(self, **values):
        self.set(**values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        for name, value in values.items():
            variable = self.variables[name]
            reference = [variable.valueReference]
            if variable.type in ("Real", "Float64"):
                (self.fmu.setFloat64 if self.v3 else self.fmu.setReal)(reference, [value])
            elif variable.type in ("Integer", "Int32"):
                (self.fmu.setInt32 if self.v3 else self.fmu.setInteger)(reference, [value])
            else:
                self.fmu.setBoolean(reference, [value])

    def get(self, name):
        variable = self.variables[name]
        reference = [variable.valueReference]
        if variable.type in ("Real", "Float64"):
            return (self.fmu.getFloat64 if self.v3 else self.fmu.getReal)(reference)[0]
        if variable.type in ("Integer", "Int32"):
            return (self.fmu.getInt32 if self.v3 else self.fmu.getInteger)(reference)[0]
        return self.fmu.getBoolean(reference)[0]

    def step(self, tick, ticks=1):
        self.fmu.doStep(tick * 1e-3, ticks * 1e-3)

    def state(self):
        return self.fmu.getFMUState() if self.v3 else self.fmu.getFMUstate()

    def restore(self, state):
        (self.fmu.setFMUState if self.v3 else self.fmu.setFMUstate)(state)

    def free(self, state):
        (self.fmu.freeFMUState if self.v3 else self.fmu.freeFMUstate)(state)

    def written(self, state):
        make = self.fmu.serializeFMUState if self.v3 else self.fmu.serializeFMUstate
        return make(state)

    def read(self, data):
        make = self.fmu.deserializeFMUState if self.v3 else self.fmu.deSerializeFMUstate
        return make(data)


def refused(work, why):
    try:
        work()
    except FMICallException:
        return
    raise AssertionError(f"{why}: it was accepted")


def export(program, library, folder, kind, fmi, axis=AXIS):
    path = folder / f"{kind}-{fmi}.fmu"
    subprocess.run(
        [program, "export", "fmu", axis, "--kind", kind, "--fmi", fmi]
        + ["--library", library, "--out", path],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return str(path)


def valves(tick):
    """On-times of the four valves, µs: out, rest, back."""
    if tick < 300:
        return [1000, 0, 0, 1000]
    if tick < 600:
        return [0, 0, 0, 0]
    return [0, 1000, 1000, 0]


NAMES = ["fill_a_us", "vent_a_us", "fill_b_us", "vent_b_us"]


def plant(archive, folder, messages):
    slave = Slave(archive, folder / "a", messages).start(seed=SEED, **{"moving.mass": 2.5})
    other = Slave(archive, folder / "b", messages).start(seed=SEED + 1)
    axis = wheeleg.Axis(AXIS).with_values({"moving.mass": "2.5 kg"})
    cylinder = wheeleg.Cylinder(axis, seed=SEED)
    expected = cylinder.run(
        np.array([valves(k) for k in range(TICKS)]),
        load_n=np.where(np.arange(TICKS) < 700, -8.0, 3.0),
    )
    columns = ["stroke_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa"]
    columns += ["friction_force_n", "supply_pa", "air_kg", "code"]
    saved = None
    for k in range(TICKS):
        inputs = dict(zip(NAMES, map(float, valves(k))), load_n=-8.0 if k < 700 else 3.0)
        slave.set(**inputs)
        if k == 900:
            saved = slave.state()
        slave.step(k)
        # Two instances do not touch each other.
        other.set(fill_b_us=500.0, load_n=20.0)
        other.step(k)
        for name in columns:
            got, want = slave.get(name), expected[name][k]
            assert got == want, (archive, k, name, got, want)
    last = slave.get("stroke_m")
    assert np.ptp(expected["stroke_m"]) > 0.1 and other.get("stroke_m") != last

    def again(one):
        for k in range(900, TICKS):
            one.set(**dict(zip(NAMES, map(float, valves(k)))), load_n=3.0)
            one.step(k)
        assert one.get("stroke_m") == last, "a state that was put back goes on as it did"

    slave.restore(saved)
    again(slave)
    data = slave.written(saved)
    elsewhere = Slave(archive, folder / "c", messages).start()
    elsewhere.restore(elsewhere.read(data))
    again(elsewhere)
    slave.free(saved)
    refused(lambda: slave.step(TICKS, 0.5), "half a tick")
    refused(lambda: slave.step(3), "another time")
    refused(lambda: slave.set(fill_a_us=1000.5), "more than a tick")
    refused(lambda: slave.set(load_n=float("nan")), "no number")
    refused(lambda: slave.set(stroke_m=0.1), "an output")
    refused(lambda: slave.read(b"{}"), "no state")
    wrong = Slave(archive, folder / "d", messages)
    wrong.set(**{"friction.coulomb": 90.0, "friction.static": 80.0})
    wrong.fmu.enterInitializationMode()
    refused(wrong.fmu.exitInitializationMode, "sliding friction above the static one")
    slave.fmu.reset()
    if not slave.v3:
        slave.fmu.setupExperiment(startTime=0.0)
    slave.start(seed=SEED)
    slave.step(0)
    slave.fmu.terminate()
    for one in (slave, other, elsewhere, wrong):
        one.fmu.freeInstance()
    return len(data)


def controlled(archive, folder, messages):
    slave = Slave(archive, folder / "a", messages).start(seed=SEED)
    bench = wheeleg.AxisSim(AXIS, seed=SEED)
    reference = np.where(np.arange(TICKS + 1) < 700, 0.12, 0.05)
    expected = bench.run(reference)
    for k in range(TICKS):
        slave.set(reference_m=float(reference[k]))
        slave.step(k)
        # The package's row is of a tick's start, the unit's outputs are of its end.
        for name in ["stroke_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "fill_a_us"]:
            got, want = slave.get(name), expected[name][k + 1]
            assert got == want, (archive, k, name, got, want)
    assert abs(slave.get("stroke_m") - 0.05) < 1e-3, slave.get("stroke_m")
    assert slave.get("driving") and slave.get("faults") == 0
    state = slave.state()
    slave.step(TICKS, 100)
    want = slave.get("stroke_m")
    slave.restore(state)
    slave.step(TICKS, 100)
    assert slave.get("stroke_m") == want
    refused(lambda: slave.written(state), "a board's state has no written form")
    slave.free(state)
    slave.fmu.freeInstance()


def main():
    program, library, folder = sys.argv[1], sys.argv[2], Path(sys.argv[3])
    figures = []
    for kind, check in (("plant", plant), ("controlled", controlled)):
        for fmi in ("2", "3"):
            archive = export(program, library, folder, kind, fmi)
            problems = validate_fmu(archive)
            assert not problems, problems
            messages = []
            at = folder / f"{kind}-{fmi}"
            written = check(archive, at, messages)
            if fmi == "3":
                assert messages and all("×" in m or "help" in m for m in messages), messages
            size = Path(archive).stat().st_size / 1e6
            figures.append(f"{kind} FMI {fmi} {size:.2f} MB" + (f", state {written} bytes" if written else ""))
            # As a user of FMPy runs it.
            result = fmpy.simulate_fmu(archive, stop_time=0.2, step_size=1e-3, output_interval=1e-3)
            assert len(result) == 201 and np.isfinite(result["stroke_m"]).all()
    refused_axis = subprocess.run(
        [program, "export", "fmu", "no-such-axis", "--out", folder / "x.fmu"], capture_output=True
    )
    assert refused_axis.returncode == 2 and not (folder / "x.fmu").exists(), refused_axis
    text = folder / "text.so"
    text.write_text("no library: fmi2Instantiate")
    for wrong in (text, "/dev/zero", folder, "/no/such.so"):
        done = subprocess.run(
            [program, "export", "fmu", AXIS, "--library", wrong, "--out", folder / "y.fmu"],
            capture_output=True,
            text=True,
        )
        # The code, not the words: a long path breaks the lines of the sentence.
        assert done.returncode == 2 and "wheeleg::fmu::library" in done.stderr, (wrong, done)
        assert not (folder / "y.fmu").exists(), wrong
    print("fmu: " + "; ".join(figures))


if __name__ == "__main__":
    main()

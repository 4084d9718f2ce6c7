"""The plant alone: what valves do, seeds, states, errors."""

import numpy as np
import pytest
import wheeleg


def pulses(ticks: int, seed: int) -> np.ndarray:
    """On-times at random, µs."""
    return np.random.default_rng(seed).integers(0, 1001, (ticks, 4)).astype(np.uint16)


def test_filling_one_chamber_and_venting_the_other_moves_the_piston():
    out, back = [1000, 0, 0, 1000], [0, 1000, 1000, 0]
    for on_us, direction in ((out, 1.0), (back, -1.0)):
        cylinder = wheeleg.Cylinder("bench-vq110u", seed=1)
        before = cylinder.outputs()["stroke_m"]
        rows = cylinder.run(np.tile(on_us, (400, 1)))
        way_m = rows["stroke_m"][-1] - before
        assert direction * way_m > 0.02, way_m
        # Between vacuum and supply; the volume grows or shrinks with the speed.
        np.testing.assert_array_less(rows["pressure_a_pa"], 720e3)
        moved_m = np.sum(rows["velocity_m_s"]) * 1e-3
        assert abs(moved_m - way_m) < 1e-3


def test_a_run_is_its_ticks_and_a_state_goes_on_bit_for_bit():
    on_us = pulses(500, 3)
    one, other = (wheeleg.Cylinder("bench-vq110u", seed=7) for _ in range(2))
    rows = one.run(on_us)
    for row in on_us:
        other.tick(row)
    assert one.state_hash() == other.state_hash()
    assert other.outputs() == {name: column[-1] for name, column in rows.items()}

    kept = one.state()
    on = one.run(pulses(200, 4))
    elsewhere = wheeleg.Cylinder("bench-vq110u", seed=99)
    elsewhere.restore(kept)
    again = elsewhere.run(pulses(200, 4))
    for name, column in on.items():
        np.testing.assert_array_equal(column, again[name], err_msg=name)
    assert one.state_hash() == elsewhere.state_hash()


def test_the_seed_makes_the_noise_and_nothing_else():
    rows = {seed: wheeleg.Cylinder("bench-vq110u", seed=seed).run(pulses(300, 5)) for seed in (1, 2)}
    same = wheeleg.Cylinder("bench-vq110u", seed=1).run(pulses(300, 5))
    np.testing.assert_array_equal(rows[1]["code"], same["code"])
    assert np.any(rows[1]["code"] != rows[2]["code"])
    np.testing.assert_array_equal(rows[1]["stroke_m"], rows[2]["stroke_m"])


def test_load_and_mass_act():
    on_us = np.tile([1000, 0, 0, 1000], (300, 1))
    free = wheeleg.Cylinder("bench-vq110u", seed=1).run(on_us)
    held = wheeleg.Cylinder("bench-vq110u", seed=1).run(on_us, np.full(300, -120.0))
    assert held["stroke_m"][-1] < free["stroke_m"][-1] - 0.005
    assert held["load_n"][-1] == -120.0
    heavy = wheeleg.Cylinder("bench-vq110u", seed=1)
    heavy.mass_kg = 50.0
    assert heavy.run(on_us)["stroke_m"][150] < free["stroke_m"][150]


@pytest.mark.parametrize(
    ("act", "told"),
    [
        (lambda c: c.tick([0, 0, 0, 1001]), r"on_us\[3\] = 1001 is outside 0 to 1000"),
        (lambda c: c.tick([0, 0.5, 0, 0]), r"on_us\[1\] = 0\.5 is not a whole number"),
        (lambda c: c.tick([0, 0, 0]), "3 values, not 4"),
        (lambda c: c.run([[0, 0, 0, 0], [0, -1, 0, 0]]), r"on_us\[1\]\[1\] = -1 is outside"),
        (lambda c: c.run([[0, 0, 0, 0]], [1.0, 2.0]), "load_n has 2 values, not 1"),
        (lambda c: c.run([[0, 0, 0, 0]], [float("nan")]), r"load_n\[0\] = NaN is outside"),
        (lambda c: setattr(c, "mass_kg", 0.0), "mass_kg = 0 is outside 0.02 to 200"),
        (lambda c: c.restore(b"{}"), "not a state of a cylinder"),
        (lambda c: wheeleg.Cylinder("bench-vq110u", seed=-1), "seed = -1 is outside 0 to 1844674"),
        (lambda c: wheeleg.Cylinder("bench-vq110u", seed=2**64), "seed = 18446744073709551616 is"),
        (lambda c: wheeleg.Cylinder("bench-vq110u", seed=10**50000), "seed = a number of very"),
        (lambda c: wheeleg.AxisSim("bench-vq110u", seed=-1), "seed = -1 is outside"),
    ],
)
def test_wrong_input_is_told_with_its_place_and_range(act, told):
    cylinder = wheeleg.Cylinder("bench-vq110u", seed=1)
    before = cylinder.state_hash()
    with pytest.raises(wheeleg.ConfigError, match=told):
        act(cylinder)
    assert cylinder.state_hash() == before


def test_a_load_beyond_the_model_ends_in_an_error_that_says_so():
    cylinder = wheeleg.Cylinder("bench-vq110u", seed=1)
    cylinder.mass_kg = 0.02
    with pytest.raises(wheeleg.SimulationError, match="is outside|no longer finite"):
        cylinder.run(np.zeros((2000, 4)), np.full(2000, 1e4))


@pytest.mark.parametrize(("name", "path"), [("mass_kg", "moving.mass"), ("load_n", "moving.load")])
@pytest.mark.parametrize("made", [wheeleg.Cylinder, wheeleg.AxisSim])
def test_ranges_of_mass_and_load_are_those_of_the_files(made, name, path):
    info = wheeleg.Axis("bench-vq110u").parameters()[path]
    axis = made("bench-vq110u", seed=1)
    for beyond in (info["min"] - 1e-3, info["max"] + 1e-3):
        with pytest.raises(wheeleg.ConfigError, match=f"{info['min']:g} to {info['max']:g}"):
            setattr(axis, name, beyond)
    for end in (info["min"], info["max"]):
        setattr(axis, name, end)
        assert getattr(axis, name) == end


def test_an_axis_has_other_values_checked_as_a_file_is():
    axis = wheeleg.Axis("bench-vq110u")
    assert "bench-vq110u" in wheeleg.Axis.built_in()
    other = axis.with_values(
        {"moving.mass": "900 g", "chamber.thermal": True, "cylinder.exponent": 1.3}
    )
    parameters = other.parameters()
    assert parameters["moving.mass"]["value"] == 900.0
    assert parameters["moving.mass"]["unit"] == "g"
    assert wheeleg.Cylinder(other, seed=1).mass_kg == 0.9
    assert axis.parameters()["moving.mass"]["value"] == 1.5
    assert wheeleg.Axis.parse(other.text).parameters() == parameters
    listed = axis.with_values({"cylinder.timing_spread": ([1.0, 1.0, 1.2, 1.0], "1")})
    assert listed.parameters()["cylinder.timing_spread"]["value"] == [1.0, 1.0, 1.2, 1.0]
    for values, told in [
        ({"moving.mass": "5000 kg"}, "moving.mass"),
        ({"moving.mass": "5 m"}, "moving.mass"),
        ({"moving.mas": "5 kg"}, "moving.mass"),
        ({"moving.mass": "heavy"}, "write a number and its unit"),
    ]:
        with pytest.raises(wheeleg.ConfigError, match=told):
            axis.with_values(values)
    with pytest.raises(wheeleg.ConfigError, match="bench-vq110u"):
        wheeleg.Axis("bench-vq110")

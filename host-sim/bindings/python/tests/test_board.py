"""The firmware of a joint board, alone and on its cylinder."""

import threading
import time

import numpy as np
import pytest
import wheeleg

STEP_M = np.concatenate([np.full(50, 0.04), np.full(1450, 0.14)])


def test_the_firmware_moves_its_cylinder_to_the_target():
    sim = wheeleg.AxisSim("bench-vq110u", seed=1)
    rows = sim.run(STEP_M)
    assert rows["time_s"][0] == 0.0
    assert abs(rows["time_s"][-1] - 1.499) < 1e-9
    end = rows["stroke_m"][-200:]
    assert np.all(np.abs(end - 0.14) < 0.5e-3), end
    assert np.max(rows["stroke_m"]) < 0.145
    assert rows["settled"][-1] == 1.0
    assert sim.snapshot()["faults"] == []
    assert sim.snapshot()["driving"]


def test_a_board_and_a_cylinder_by_hand_are_the_simulation_bit_for_bit():
    sim = wheeleg.AxisSim("bench-vq110u", seed=5)
    rows = sim.run(STEP_M[:600])
    said = sim.snapshot()
    board = wheeleg.Board("bench-vq110u")
    cylinder = wheeleg.Cylinder("bench-vq110u", seed=5)
    on_us = np.zeros(4, np.uint16)
    for k, reference_m in enumerate(STEP_M[:600]):
        outputs = cylinder.outputs()
        for name in ("stroke_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "air_kg"):
            assert outputs[name] == rows[name][k], (k, name)
        before, on_us = on_us, board.tick(outputs["code"], reference_m)
        assert before[0] == rows["fill_a_us"][k]
        cylinder.tick(before)
    assert board.snapshot() == said


@pytest.mark.parametrize("law", wheeleg.LAWS)
def test_a_state_goes_on_bit_for_bit_in_every_law(law):
    sim = wheeleg.AxisSim("bench-vq110u", seed=2, law=law)
    sim.run(STEP_M[:400])
    kept = sim.state()
    first = sim.run(STEP_M[400:])
    hash_ = sim.state_hash()
    # What has been simulated since must not be in the state.
    for other in (sim, wheeleg.AxisSim("bench-vq110u", seed=9, law=law)):
        other.restore(kept)
        again = other.run(STEP_M[400:])
        for name, column in first.items():
            np.testing.assert_array_equal(column, again[name], err_msg=name)
        assert other.state_hash() == hash_
        assert other.snapshot() == sim.snapshot()


def test_a_board_goes_on_from_its_state():
    codes = 16 * (1000 + np.arange(200))
    board = wheeleg.Board("bench-vq110u")
    board.run(codes, np.full(200, 0.1))
    kept = board.state()
    first = board.run(codes[::-1], np.full(200, 0.1), np.zeros(200))
    board.restore(kept)
    second = [board.tick(code, 0.1) for code in codes[::-1]]
    np.testing.assert_array_equal(first, second)
    assert board.run([], []).shape == (0, 4)


def test_law_parameters_and_sheet_reach_the_board():
    sim = wheeleg.AxisSim("bench-vq110u", seed=1, law="pwm-p", parameters={"proportional": 0.004})
    assert abs(sim.parameters()["proportional"] - 0.004) < 1e-5
    strong = wheeleg.AxisSim("bench-vq110u", seed=1, law="pwm-p", parameters={"proportional": 0.04})
    # Ten times the gain: less careful, and there sooner.
    after_ms = [np.argmax(s.run(STEP_M)["stroke_m"] > 0.13) for s in (sim, strong)]
    assert 50 < after_ms[1] < after_ms[0] - 20, after_ms
    axis = wheeleg.Axis("bench-vq110u")
    heavy = axis.with_values({"moving.mass": "6 kg"})
    told = wheeleg.AxisSim(heavy, seed=1, sheet=axis)
    assert told.mass_kg == 6.0
    assert abs(told.parameters()["moving_mass"] - 1.5) < 1e-3
    for arguments, words in [
        ({"law": "pid"}, "predictive"),
        ({"parameters": {"proportionl": 1.0}}, "did you mean \"proportional\""),
        ({"parameters": {"proportional": -1.0}}, "a joint board allows"),
        ({"parameters": {"proportional": float("nan")}}, "a joint board allows"),
    ]:
        with pytest.raises(wheeleg.ConfigError, match=words):
            wheeleg.AxisSim("bench-vq110u", seed=1, **arguments)


def test_another_thread_runs_while_it_simulates():
    sim = wheeleg.AxisSim("bench-vq110u", seed=1)
    reference_m = np.tile(STEP_M, 20)
    steps, running = 0, True

    def count():
        nonlocal steps
        while running:
            steps += 1
            time.sleep(0)

    other = threading.Thread(target=count)
    other.start()
    try:
        before = steps
        sim.run(reference_m)
        counted = steps - before
    finally:
        running = False
        other.join()
    # With the lock held there would be one switch per chunk, 15 of them.
    assert counted > 100, counted


def test_speed_beside_the_bar():
    sim = wheeleg.AxisSim("bench-vq110u", seed=1)
    reference_m = np.tile(STEP_M, 20)
    begin = time.process_time()
    sim.run(reference_m)
    busy_s = time.process_time() - begin
    per_s = len(reference_m) / busy_s
    print(f"python: AxisSim.run {per_s:.0f} ticks per busy second, {per_s / 1000:.0f} x real time (bar 150)")
    begin = time.process_time()
    for reference in STEP_M:
        sim.tick(reference)
    each = len(STEP_M) / (time.process_time() - begin)
    print(f"python: AxisSim.tick {each:.0f} ticks per busy second")
    # Far below the bar: what a busy machine cannot explain.
    assert per_s > 20_000

"""The whole robot."""

import os
import subprocess

import numpy as np
import pytest
import wheeleg


def test_the_log_is_that_of_the_program(tmp_path):
    program = os.environ.get("WHEELEG")
    if not program:
        pytest.skip("WHEELEG names no program")
    robot = wheeleg.Robot("stand", seed=4)
    robot.run()
    assert robot.is_over
    told = subprocess.run(
        [program, "run", "stand", "--seed", "4", "--out", str(tmp_path / "run")],
        check=True,
        capture_output=True,
        text=True,
    )
    assert robot.log_hash() in told.stdout + told.stderr


def test_a_command_moves_a_joint_and_the_state_goes_on_bit_for_bit():
    robot = wheeleg.Robot("stand", seed=1)
    assert robot.time_s == 0.0
    home_m = robot.observe()["stroke_m"]
    robot.command("JointReference", joint=2, stroke=f"{1e3 * home_m[1] + 20:.1f} mm")
    rows = robot.run(0.4, every_s=0.05)
    kept = robot.state()
    later = robot.run(0.6)
    moved_m = later["stroke_m"][-1] - home_m
    assert abs(moved_m[1] - 0.02) < 1e-3, moved_m
    assert abs(moved_m[4]) < 2e-3
    assert rows["stroke_m"].shape == (8, 6)
    assert rows["pressure_pa"].shape == (8, 12)
    np.testing.assert_allclose(np.diff(rows["time_s"]), 0.05)
    end = robot.log_hash()
    other = wheeleg.Robot("stand", seed=1)
    other.restore(kept)
    assert abs(other.time_s - 0.4) < 1e-9
    again = other.run(0.6)
    np.testing.assert_array_equal(later["stroke_m"], again["stroke_m"])
    assert other.log_hash() == end
    # Cut into ticks it is the same, and another seed is not.
    robot.restore(kept)
    for _ in range(600):
        robot.tick()
    assert robot.log_hash() == end
    with pytest.raises(wheeleg.ConfigError, match="another scenario, robot, seed"):
        wheeleg.Robot("stand", seed=2).restore(kept)


def test_wrong_and_refused_commands_say_why_and_leave_an_event():
    robot = wheeleg.Robot("stand", seed=1)
    robot.take_events()
    for name, arguments, told in [
        ("JointReference", {"joint": 9, "stroke": "80 mm"}, "1 to 6"),
        ("JointReference", {"joint": 2, "stroke": "8 m"}, "allowed 0 to 0.18 m"),
        ("JointReference", {"joint": 2}, "stroke"),
        ("JointReferenc", {}, "JointReference"),
        ("Arm", {"joint": 2}, "no arguments"),
    ]:
        with pytest.raises(wheeleg.ConfigError, match=told):
            robot.command(name, **arguments)
    # Refused at the door: nothing takes commands while no time passes.
    with pytest.raises(wheeleg.ConfigError, match="the master refuses JointReference"):
        for _ in range(200):
            robot.command("JointReference", joint=2, stroke="20 mm")
    robot.run(0.05)
    # Refused when its turn comes.
    robot.command("EmergencyStop")
    robot.run(0.1)
    robot.command("StartGait")
    robot.run(0.05)
    codes = [event["code"] for event in robot.take_events()]
    assert "command_rejected" in codes and "command_refused" in codes
    assert robot.take_events() == []


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"joint": 2, "stroke": 2**70}, str(2**70)),
        ({"joint": 2, "stroke": float("nan")}, "stroke"),
        ({"joint": 2, "stroke": float("inf")}, "stroke"),
        ({"joint": 2, "stroke": "80\x7fmm"}, "stroke"),
        ({"joint": 2, "stroke": "80 mm", "a = 1\n[motion]\nb": 3}, "unknown field"),
        ({"joint": 2**64, "stroke": "80 mm"}, "joint"),
        ({"joint": True, "stroke": "80 mm"}, "joint"),
        ({"joint": 2, "stroke": "80 mm", "": 1}, "unknown field"),
    ],
)
def test_arguments_of_commands_are_quoted_and_told_by_their_names(arguments, told):
    robot = wheeleg.Robot("stand", seed=1)
    with pytest.raises(wheeleg.ConfigError) as raised:
        robot.command("JointReference", **arguments)
    said = str(raised.value)
    assert told in said and "not valid TOML" not in said, said


def test_a_case_of_a_campaign_and_bad_names():
    cases = wheeleg.Robot.cases_of("three-step-spread")
    one, other = (wheeleg.Robot.of_case("three-step-spread", k) for k in (0, 1))
    assert one.seed == other.seed or one.log_hash() != other.log_hash()
    with pytest.raises(wheeleg.ConfigError, match=f"outside 0 to {cases - 1}"):
        wheeleg.Robot.of_case("three-step-spread", cases)
    with pytest.raises(wheeleg.ConfigError, match="index = -1 is outside"):
        wheeleg.Robot.of_case("three-step-spread", -1)
    with pytest.raises(wheeleg.ConfigError, match=f"seed = {2**64} is outside 0 to {2**64 - 1}"):
        wheeleg.Robot("stand", seed=2**64)
    assert wheeleg.Robot("stand", seed=2**64 - 1).seed == 2**64 - 1
    with pytest.raises(wheeleg.ConfigError, match="stand"):
        wheeleg.Robot("stnd", seed=1)
    with pytest.raises(wheeleg.ConfigError, match="wheeleg"):
        wheeleg.Robot("stand", robot="weeleg", seed=1)
    for seconds in (-1.0, 0.0005, float("nan")):
        with pytest.raises(wheeleg.ConfigError, match="seconds"):
            one.run(seconds)

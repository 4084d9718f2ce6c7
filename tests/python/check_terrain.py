"""Compare the robot on rigid ground with MuJoCo.

    check_terrain.py RESULTS

RESULTS is what the example `rigid_terrain` of wheeleg-plant printed: the robot as one body with two
wheels, and what our plant makes of it on slopes, at an edge and in a turn. MuJoCo gets the same
masses and sizes, its own contacts (elliptic cones) and a slope by tilting gravity; legs are part of
the body. Exit status 0 if all agree within the tolerances, 1 if not, 2 for unusable input.

MuJoCo's contacts have no memory of position, so a robot on a slope creeps in it; its forces are
taken while it does. That is not copied.
"""

import json
import math
import sys
from pathlib import Path

import mujoco
import numpy as np

GRAVITY = 9.81
STEP_S = 5e-4
LOCKED = 1e4
# A contact that MuJoCo loses for less than this is not lost (steps).
LOST = 60


def minus_wheels(body):
    """Mass, centre and inertia about it of all but the wheels."""
    mass, wheel = body["mass_kg"], body["wheel_mass_kg"]
    moment = mass * np.array(body["com_m"])
    inertia = np.array(body["inertia_kg_m2"])
    for side in (1, -1):
        place = np.array([0.0, side * body["track_m"] / 2, 0.0])
        moment -= wheel * place
        own = np.diag([body["wheel_transverse_kg_m2"], body["wheel_inertia_kg_m2"], body["wheel_transverse_kg_m2"]])
        inertia -= own + wheel * (place @ place * np.eye(3) - np.outer(place, place))
    rest = mass - 2 * wheel
    com = moment / rest
    return rest, com, inertia - rest * (com @ com * np.eye(3) - np.outer(com, com))


def model(body, slope_deg=0.0, wheel_damping=0.0, rubbing_feet=True, edge_m=None, actuator="", across=False, mu=None):
    """The robot in MuJoCo, the ground level and gravity tilted; uphill is ahead, or to the left with a slope across."""
    mass, com, inertia = minus_wheels(body)
    full = " ".join(str(inertia[i]) for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    radius, half = body["wheel_radius_m"], body["wheel_width_m"] / 2
    slope = math.radians(slope_deg)
    along = -GRAVITY * math.sin(slope)
    gravity = f"{0 if across else along} {along if across else 0} {-GRAVITY * math.cos(slope)}"
    mu = body["mu"] if mu is None else mu
    feet = ""
    for leg, (x, y, z) in enumerate(body["soles_m"]):
        for a, b in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)):
            ring, ball = body["ring_m"], body["sphere_m"]
            rub = mu if rubbing_feet else 0
            feet += (
                f'<geom name="foot{leg}{a}{b}" type="sphere" size="{ball}" mass="0" condim="{3 if rubbing_feet else 1}" '
                f'friction="{rub} 0 0" pos="{x + ring * a} {y + ring * b} {z + ball}"/>'
            )
    wheels = ""
    for name, side in (("left", 1), ("right", -1)):
        wheels += f"""
      <body name="{name}" pos="0 {side * body["track_m"] / 2} 0">
        <inertial pos="0 0 0" mass="{body["wheel_mass_kg"]}"
          diaginertia="{body["wheel_transverse_kg_m2"]} {body["wheel_inertia_kg_m2"]} {body["wheel_transverse_kg_m2"]}"/>
        <joint name="{name}" type="hinge" axis="0 1 0" damping="{wheel_damping}" armature="{body["armature_kg_m2"]}"/>
        <geom name="wheel_{name}" type="cylinder" size="{radius} {half}" quat="0.70710678 0.70710678 0 0" mass="0"
          friction="{mu} 0 0"/>
      </body>"""
    edge = ""
    if edge_m:
        lever = math.sqrt(radius**2 - (radius - edge_m) ** 2)
        edge = f'<geom name="edge" type="box" size="0.1 1 {edge_m / 2}" pos="{lever + 0.101} 0 {edge_m / 2}" friction="0 0 0"/>'
    text = f"""
<mujoco>
  <compiler autolimits="true"/>
  <option timestep="{STEP_S}" gravity="{gravity}" cone="elliptic" impratio="20" integrator="implicitfast"/>
  <default><geom solref="0.002 1" solimp="0.99 0.999 0.0005"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="50 50 1" friction="0 0 0"/>
    {edge}
    <body name="robot" pos="0 0 {radius}">
      <freejoint/>
      <inertial pos="{com[0]} {com[1]} {com[2]}" mass="{mass}" fullinertia="{full}"/>
      {feet}{wheels}
    </body>
  </worldbody>
  <actuator>{actuator}</actuator>
</mujoco>"""
    built = mujoco.MjModel.from_xml_string(text)
    return built, mujoco.MjData(built)


def normals(m, d):
    """Normal force by the first letters of the geoms: wheels left and right, feet left and right; and on the floor alone."""
    total, floor = {}, {}
    for i in range(d.ncon):
        contact = d.contact[i]
        force = np.zeros(6)
        mujoco.mj_contactForce(m, d, i, force)
        names = [mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_GEOM, g) for g in (contact.geom1, contact.geom2)]
        own = next(n for n in names if n not in ("floor", "edge"))
        key = own if own.startswith("wheel") else own[:5]
        total[key] = total.get(key, 0.0) + force[0]
        if "floor" in names:
            floor[key] = floor.get(key, 0.0) + force[0]
    return total, floor


def settle(m, d, seconds):
    for _ in range(round(seconds / STEP_S)):
        mujoco.mj_step(m, d)


class Checks:
    """What was compared, and what does not agree."""

    def __init__(self):
        self.failed = 0

    def near(self, what, ours, theirs, tolerance, unit):
        good = abs(ours - theirs) <= tolerance
        self.failed += not good
        print(f"{'ok  ' if good else 'FAIL'} {what}: {ours:.4f} {unit}, expected {theirs:.4f}, within {tolerance:.4f}")


def check_static(checks, results):
    for case in results["static"]:
        body = results["body_three" if case["three"] else "body"]
        m, d = model(body, case["slope_deg"], wheel_damping=LOCKED)
        settle(m, d, 1.0)
        # Forces of a robot that rests tremble by a step; the mean does not.
        mean = {}
        for _ in range(200):
            mujoco.mj_step(m, d)
            for key, force in normals(m, d)[0].items():
                mean[key] = mean.get(key, 0.0) + force / 200
        name = f"{'three' if case['three'] else 'four'} supports at {case['slope_deg']:.0f}°"
        for key, ours in zip(("wheel_left", "wheel_right"), case["wheels_n"]):
            checks.near(f"{name}, {key}", ours, mean.get(key, 0.0), 0.01 * ours, "N")
        feet = sum(case["feet_n"])
        theirs = mean.get("foot0", 0.0) + mean.get("foot1", 0.0)
        share = 0.02 if case["slope_deg"] == 20 else 0.01
        checks.near(f"{name}, feet", feet, theirs, share * feet, "N")


def check_roll(checks, results):
    m, d = model(results["body"], 10.0, rubbing_feet=False)
    while d.qpos[0] > -1.0 and d.time < 10:
        mujoco.mj_step(m, d)
    ours = results["roll_speed_m_s"]
    checks.near("speed after 1 m down 10°", ours, float(np.linalg.norm(d.qvel[:3])), 0.02 * ours, "m/s")


def check_slide(checks, results):
    mu, slope = results["slide_mu"], math.radians(25)
    m, d = model(results["body"], 25.0, wheel_damping=LOCKED, across=True, mu=mu)
    while d.qpos[1] > -1.0 and d.time < 10:
        mujoco.mj_step(m, d)
    ours = results["slide_speed_m_s"]
    name = f"speed after 1 m down 25° with a friction of {mu}"
    checks.near(name, ours, float(np.linalg.norm(d.qvel[:3])), 0.02 * ours, "m/s")
    # Both beside what a block would do, v² = 2 g (sin α - μ cos α) s.
    block = math.sqrt(2 * GRAVITY * (math.sin(slope) - mu * math.cos(slope)))
    checks.near(f"{name}, beside a block's", ours, block, 0.02 * block, "m/s")


def check_drop(checks, results):
    m, d = model(results["body"], wheel_damping=LOCKED)
    d.qpos[2] += 0.02
    settle(m, d, 3.0)
    checks.near("height of the axle after a drop", results["drop_height_m"], float(d.qpos[2]), 5e-4, "m")


def check_step(checks, results):
    motors = '<motor joint="left"/><motor joint="right"/>'
    m, d = model(results["body"], rubbing_feet=False, edge_m=results["step_height_m"], actuator=motors)
    settle(m, d, 0.5)
    lost, torque = 0, 0.0
    while d.time < 60 and lost < LOST:
        d.ctrl[:] = 0.5 * (d.time - 0.5)
        mujoco.mj_step(m, d)
        total, floor = normals(m, d)
        if floor.get("wheel_left", 0) + floor.get("wheel_right", 0) > 0:
            lost, torque = 0, float(d.ctrl.sum())
        else:
            lost += 1
    ours = results["step_torque_n_m"]
    checks.near("torque of both wheels at an edge of 20 mm", ours, torque, 0.05 * ours, "N m")


def check_arc(checks, results):
    arc = results["arc"]
    speeds = '<velocity joint="left" kv="200"/><velocity joint="right" kv="200"/>'
    m, d = model(results["body"], rubbing_feet=False, actuator=speeds)
    d.ctrl[:] = arc["rates_rad_s"]
    settle(m, d, 1.0)

    def yaw():
        w, x, y, z = d.qpos[3:7]
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    begun, rolled = yaw(), d.qpos[7:9].copy()
    settle(m, d, arc["seconds"])
    ours = arc["turned_rad"]
    # Its wheels follow their speeds with a lag of their own.
    asked = arc["seconds"] * (arc["rates_rad_s"][1] - arc["rates_rad_s"][0])
    rolled = d.qpos[7:9] - rolled
    theirs = (yaw() - begun) * asked / (rolled[1] - rolled[0])
    checks.near("heading after an arc", ours, theirs, 0.03 * ours, "rad")


def check_tip_back(checks, results):
    m, d = model(results["body"], 20.0, wheel_damping=LOCKED)
    settle(m, d, 1.0)
    degrees, lost, last = 20.0, 0, 20.0
    while degrees < 30 and lost < LOST:
        degrees += 0.5 * STEP_S
        slope = math.radians(degrees)
        m.opt.gravity[:] = (-GRAVITY * math.sin(slope), 0, -GRAVITY * math.cos(slope))
        mujoco.mj_step(m, d)
        total, _ = normals(m, d)
        if total.get("foot0", 0.0) + total.get("foot1", 0.0) > 0:
            lost, last = 0, degrees
        else:
            lost += 1
    checks.near("slope of tip-back", results["tip_back_deg"], last, 0.3, "degrees")


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        results = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        print(f"{sys.argv[1]}: {error}", file=sys.stderr)
        return 2
    checks = Checks()
    for check in (check_static, check_roll, check_slide, check_drop, check_step, check_arc, check_tip_back):
        check(checks, results)
    print(f"{checks.failed} of the figures do not agree" if checks.failed else "all figures agree")
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())

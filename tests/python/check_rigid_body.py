"""Compare the floating robot's dynamics with Pinocchio.

    check_rigid_body.py URDF STATES [--tolerance T] [--seeded-errors]

URDF is what `wheeleg export urdf` wrote, STATES what the example
`floating_states` of wheeleg-studies printed. For every state Pinocchio computes
mass matrix and bias of the open tree; rotor inertia, which URDF cannot hold, is
added; and the yaw loops are closed with constraint Jacobians that Pinocchio
computes at the cut (crank end against yaw carriage). Nothing of our own
kinematics is used: the loop is closed by Newton's method, its rates follow
from the constraint.

Compared are mass matrix, bias with gravity, generalised contact forces,
acceleration, mass centre and momentum, each relative to its largest entry.
Exit status 0 if all agree within the tolerance, 1 if not, 2 for unusable input.

With --seeded-errors the comparison itself is tested: each mass, each inertia, each
centre of mass and each joint place of the URDF is falsified in turn, and every one of
these robots must be told from the true one.
"""

import argparse
import json
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin

TOLERANCE = 1e-9
SIDES = ("left", "right")
DRIVES = {
    "left": ("/joint/1", "/joint/2", "/joint/3"),
    "right": ("/joint/4", "/joint/5", "/joint/6"),
}
WHEELS = ("/wheel/7", "/wheel/8")
PASSIVE = ("theta1", "theta3", "theta4")
DOF = 14
LWA = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
# States used for each seeded error.
SEEDED_STATES = 3


class Unusable(Exception):
    """Input that cannot be compared."""


class Robot:
    """The open tree in Pinocchio, with the names that our 14 velocities have in it."""

    def __init__(self, urdf_text, rotor_inertia, gear):
        self.model = pin.buildModelFromXML(urdf_text, pin.JointModelFreeFlyer())
        self.data = self.model.createData()
        self.rotor, self.gear = rotor_inertia, gear
        self.loops = [
            (
                self.frame(f"{side}_crank_end"),
                self.frame(f"{side}_yaw_carriage"),
                [self.velocity_index(f"{side}_{name}") for name in PASSIVE],
            )
            for side in SIDES
        ]
        self.contacts = [self.frame(name) for name in ("left_foot", "right_foot", "left_wheel", "right_wheel", "base_link")]
        # Pinocchio's free flyer has the linear part first; ours the angular one.
        drives = [self.velocity_index(name) for side in SIDES for name in DRIVES[side]]
        self.independent = [3, 4, 5, 0, 1, 2, *drives, *(self.velocity_index(name) for name in WHEELS)]
        passive = [i for _, _, own in self.loops for i in own]
        if sorted(self.independent + passive) != list(range(self.model.nv)):
            raise Unusable(f"{self.model.nv} velocities in the URDF, not the {DOF + len(passive)} expected")

    def joint(self, name):
        if not self.model.existJointName(name):
            raise Unusable(f"no joint {name} in the URDF")
        return self.model.joints[self.model.getJointId(name)]

    def velocity_index(self, name):
        return self.joint(name).idx_v

    def frame(self, name):
        if not self.model.existFrame(name):
            raise Unusable(f"no link {name} in the URDF")
        return self.model.getFrameId(name)

    def configuration(self, state):
        """Position vector with both loops closed, by Newton's method from zero."""
        q = pin.neutral(self.model)
        q[0:3] = state["position_m"]
        q[3:7] = state["orientation"]
        for names, strokes in zip(DRIVES.values(), (state["strokes_m"][:3], state["strokes_m"][3:])):
            for name, stroke in zip(names, strokes):
                q[self.joint(name).idx_q] = stroke
        for name, angle in zip(WHEELS, state["wheel_rad"]):
            at = self.joint(name).idx_q
            q[at], q[at + 1] = np.cos(angle), np.sin(angle)
        for _ in range(50):
            pin.computeJointJacobians(self.model, self.data, q)
            pin.updateFramePlacements(self.model, self.data)
            step, worst = np.zeros(self.model.nv), 0.0
            for a, b, own in self.loops:
                gap = self.gap(a, b)
                step[own] = np.linalg.lstsq(self.relative(a, b)[:, own], -gap, rcond=None)[0]
                worst = max(worst, np.abs(step[own]).max())
            q = pin.integrate(self.model, q, step)
            if worst < 1e-15:
                break
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        open_by = max(np.abs(self.gap(a, b)).max() for a, b, _ in self.loops)
        if open_by > 1e-12:
            raise Unusable(f"the loop stays open by {open_by:.1e}")
        return q

    def gap(self, a, b):
        """Place and attitude of frame a against frame b, world axes."""
        first, second = self.data.oMf[a], self.data.oMf[b]
        turn = pin.log3(first.rotation @ second.rotation.T)
        return np.concatenate([first.translation - second.translation, turn])

    def relative(self, a, b):
        """Jacobian of the velocity of frame a against frame b."""
        jacobian = [pin.getFrameJacobian(self.model, self.data, i, LWA) for i in (a, b)]
        return jacobian[0] - jacobian[1]

    def closure(self, q, reduced):
        """G with v = G u, the drift of v for constant u, and v itself."""
        g = np.zeros((self.model.nv, DOF))
        g[self.independent, range(DOF)] = 1.0
        inverses = []
        for a, b, own in self.loops:
            constraint = self.relative(a, b)
            if np.linalg.matrix_rank(constraint[:, own], tol=1e-6) != len(own):
                raise Unusable("the cut does not determine the passive joints")
            inverse = np.linalg.pinv(constraint[:, own])
            g[own, :] = -inverse @ (constraint[:, self.independent])
            if np.abs(constraint @ g).max() > 1e-12:
                raise Unusable("the loop does not let the drives move")
            inverses.append(inverse)
        v = g @ reduced
        drift = np.zeros(self.model.nv)
        pin.forwardKinematics(self.model, self.data, q, v, drift)
        for (a, b, own), inverse in zip(self.loops, inverses):
            first, second = (
                pin.getFrameClassicalAcceleration(self.model, self.data, i, LWA).vector for i in (a, b)
            )
            drift[own] = -inverse @ (first - second)
        return g, drift, v

    def add_rotors(self, mass, bias, v, acceleration):
        """A rotor has inertia about the axle alone, and turns with the chassis and geared to its wheel."""
        omega = v[3:6]
        for wheel in (self.velocity_index(name) for name in WHEELS):
            row = np.zeros(self.model.nv)
            row[4], row[wheel] = 1.0, self.gear
            mass += self.rotor * np.outer(row, row)
            bias += self.rotor * row * (row @ acceleration)
            bias[3:6] += np.cross(omega, [0.0, self.rotor * (row @ v), 0.0])

    def quantities(self, state):
        """What is compared, by name."""
        reduced = np.array(state["velocity"])
        self.model.gravity.linear = np.array(state["gravity_m_s2"])
        q = self.configuration(state)
        g, drift, v = self.closure(q, reduced)
        contact = np.zeros(self.model.nv)
        for i, wrench in zip(self.contacts, state["contacts"]):
            moment_force = np.array(wrench)
            jacobian = pin.getFrameJacobian(self.model, self.data, i, LWA)
            contact += jacobian.T @ np.concatenate([moment_force[3:], moment_force[:3]])
        mass = pin.crba(self.model, self.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        bias = pin.rnea(self.model, self.data, q, v, drift).copy()
        self.add_rotors(mass, bias, v, drift)
        mass, bias, contact = g.T @ mass @ g, g.T @ bias, g.T @ contact
        acceleration = np.linalg.solve(mass, np.array(state["force"]) + contact - bias)
        pin.computeCentroidalMomentum(self.model, self.data, q, v)
        momentum = self.data.hg.vector.copy()
        spin = self.rotor * sum(v[4] + self.gear * v[self.velocity_index(name)] for name in WHEELS)
        momentum[3:] += self.data.oMi[1].rotation[:, 1] * spin
        return {
            "mass_matrix": mass,
            "bias": bias,
            "contact_force": contact,
            "acceleration": acceleration,
            "com_m": self.data.com[0].copy(),
            "linear_momentum": momentum[:3],
            "angular_momentum": momentum[3:],
        }


def worst_errors(robot, states):
    """Largest relative error of each quantity over the states."""
    worst = {}
    for state in states:
        for name, theirs in robot.quantities(state).items():
            ours = np.array(state[name])
            if ours.shape != theirs.shape or not np.isfinite(ours).all():
                raise Unusable(f"{name} of a state is not an array of {theirs.shape} finite numbers")
            # NaN would pass every comparison below.
            if not np.isfinite(theirs).all() or not theirs.any():
                raise Unusable(f"Pinocchio's {name} of a state is zero or not finite")
            error = np.abs(ours - theirs).max() / np.abs(theirs).max()
            worst[name] = max(worst.get(name, 0.0), float(error))
    return worst


def seeded_errors(urdf_text):
    """(what was falsified, URDF text)"""
    tree = ElementTree.fromstring(urdf_text)

    def changed(element, attribute, change):
        old = element.get(attribute)
        element.set(attribute, change(old))
        text = ElementTree.tostring(tree, encoding="unicode")
        element.set(attribute, old)
        return text

    def grown(text):
        return repr(float(text) * 1.01)

    def shifted(axis):
        def shift(text):
            numbers = [float(number) for number in text.split()]
            numbers[axis] += 1e-4
            return " ".join(repr(number) for number in numbers)

        return shift

    for link in tree.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        name = link.get("name")
        yield f"mass of {name} + 1 %", changed(inertial.find("mass"), "value", grown)
        inertia = inertial.find("inertia")
        for entry in ("ixx", "iyy", "izz"):
            yield f"{entry} of {name} + 1 %", changed(inertia, entry, grown)
        for axis in range(3):
            what = f"mass centre of {name} + 0.1 mm along {'xyz'[axis]}"
            yield what, changed(inertial.find("origin"), "xyz", shifted(axis))
    for joint in tree.findall("joint"):
        # A fixed joint to the same place is no dynamics of its own.
        if joint.get("type") in ("revolute", "continuous"):
            for axis in range(2):
                what = f"{joint.get('name')} + 0.1 mm along {'xyz'[axis]}"
                yield what, changed(joint.find("origin"), "xyz", shifted(axis))


def check_seeded_errors(text, file, tolerance):
    """True if every falsified robot is told from the true one."""
    states = file["states"][:SEEDED_STATES]
    missed, count, weakest = [], 0, (np.inf, "")
    for what, falsified in seeded_errors(text):
        count += 1
        # Every one of them is a robot that can be computed: what cannot is no error noticed.
        robot = Robot(falsified, file["rotor_inertia_kg_m2"], file["gear_ratio"])
        error = max(worst_errors(robot, states).values())
        weakest = min(weakest, (error, what))
        if error <= tolerance:
            missed.append(what)
    print(f"{count} seeded errors, {len(missed)} missed; the least visible: {weakest[1]} ({weakest[0]:.1e})")
    for what in missed:
        print(f"  not noticed: {what}")
    return count > 50 and not missed


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdf", type=Path)
    parser.add_argument("states", type=Path)
    parser.add_argument("--tolerance", type=float, default=TOLERANCE)
    parser.add_argument("--seeded-errors", action="store_true")
    options = parser.parse_args(arguments)
    try:
        text = options.urdf.read_text(encoding="utf-8")
        file = json.loads(options.states.read_text(encoding="utf-8"))
        if file.get("schema") != "wheeleg-floating-states/1" or not file["states"]:
            raise Unusable(f"{options.states} holds no states")
        if options.seeded_errors:
            return 0 if check_seeded_errors(text, file, options.tolerance) else 1
        robot = Robot(text, file["rotor_inertia_kg_m2"], file["gear_ratio"])
        worst = worst_errors(robot, file["states"])
    except (OSError, ValueError, KeyError, Unusable) as error:
        print(f"cannot compare: {error!r}", file=sys.stderr)
        return 2
    print(f"{len(file['states'])} states, Pinocchio {pin.__version__}; worst error relative to the largest entry")
    for name, error in worst.items():
        print(f"  {name:17} {error:.1e}  {'ok' if error <= options.tolerance else 'BEYOND ' + str(options.tolerance)}")
    return 0 if all(error <= options.tolerance for error in worst.values()) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

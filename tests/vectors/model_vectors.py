"""Reference vectors of the leg and the half robot for any seed and any robot.

    python3 model_vectors.py

writes the files of this folder that have a generator; with arguments, one file of your own:

    python3 model_vectors.py --seed 99 --cases 50 --out mine.json

Independent of the simulator: written from host-sim/plant/MODEL.md, and from as little of it as
possible. Only *positions* are taken from there: the Denavit-Hartenberg matrix of section 1 with
Tables 1 and 2, and the closure of the loop (A4). Everything else is differentiated numerically in
60-digit arithmetic (central differences, step 1e-18, truncation below 1e-30), so no formula for a
velocity, an acceleration, T or its derivative is typed twice. The results are rounded to double
once, at the end: the files are the same on every machine, whatever its mathematics library.

Before a file is written, every case is checked against a second way of its own: forces against
Lagrange's equations of the summed kinetic energy, K T = 0 in the form of the closed loop, and
power against the energies. Keys with `printed` follow the printed forms of MODEL.md section 10.
"""

import argparse
import json
import random

from mpmath import mp, mpf, matrix, cos, sin, acos, atan2, pi, sqrt, floor

mp.dps = 60
STEP = mpf(10) ** -18
# What two ways to the same number may differ by.
AGREE = mpf(10) ** -20

# MODEL.md section 9: PAPER for crank, p4, gears; ASSUMED for the rest. The decimal numbers are
# those of the file, so they enter as their double values.
WHEELEG_2003 = {
    "crank": 0.29,
    "p4": [0.29, 0.40],
    "b5_home": 0.01,
    "b6_home": 0.01,
    "stroke": 0.18,
    "gravity": [0.0, 0.0, -9.81],
    "viscous": [20.0, 15.0, 15.0],
    "chassis_mass": 15.4,
    "wheel_mass": 1.2,
    "wheel_radius": 0.15,
    "wheel_inertia": 0.0162,
    "rotor_inertia": 2e-06,
    "gear_motor": 130.0,
    "gear_chain": 2.0,
    "wheel_viscous": 4.0,
    "bodies": [
        {"m": 0.40, "com": [0.004, 0.0, 0.120], "inertia_diag": [1.30e-3, 1.30e-3, 1.0e-4]},
        {"m": 0.20, "com": [0.003, -0.150, 0.0], "inertia_diag": [1.00e-3, 3.0e-5, 1.00e-3]},
        {"m": 0.30, "com": [-0.120, 0.006, 0.0], "inertia_diag": [1.0e-4, 2.20e-3, 2.20e-3]},
        {"m": 1.00, "com": [0.010, 0.020, 0.050], "inertia_diag": [8.0e-3, 8.0e-3, 1.5e-3]},
        {"m": 0.90, "com": [0.008, -0.030, 0.020], "inertia_diag": [7.0e-3, 7.0e-3, 1.2e-3]},
        {"m": 0.80, "com": [0.0, 0.005, -0.100], "inertia_diag": [4.5e-3, 4.5e-3, 4.0e-4]},
    ],
}

# Another robot: nothing in it is the paper's, so that no number can come from a default.
OTHER_ROBOT = {
    "crank": 0.22,
    "p4": [0.35, 0.31],
    "stroke": 0.18,
    "viscous": [11.0, 7.5, 3.25],
    "chassis_mass": 9.7,
    "wheel_mass": 0.85,
    "wheel_radius": 0.11,
    "wheel_inertia": 0.0071,
    "rotor_inertia": 3.1e-06,
    "gear_motor": 43.0,
    "gear_chain": 1.5,
    "wheel_viscous": 2.2,
    "bodies": [
        {"m": 0.55, "com": [-0.011, 0.007, 0.090], "inertia_diag": [2.1e-3, 1.7e-3, 2.3e-4]},
        {"m": 0.31, "com": [0.009, -0.110, 0.004], "inertia_diag": [1.4e-3, 6.0e-5, 1.2e-3]},
        {"m": 0.42, "com": [-0.090, -0.012, 0.015], "inertia_diag": [3.0e-4, 1.9e-3, 2.5e-3]},
        {"m": 1.35, "com": [-0.021, 0.030, 0.065], "inertia_diag": [9.1e-3, 6.2e-3, 2.4e-3]},
        {"m": 0.66, "com": [0.017, 0.041, -0.013], "inertia_diag": [5.5e-3, 6.1e-3, 1.9e-3]},
        {"m": 1.12, "com": [0.006, -0.008, -0.140], "inertia_diag": [3.9e-3, 5.0e-3, 7.0e-4]},
    ],
}

FILES = [
    ("model-11.json", 11, 20, WHEELEG_2003),
    ("other-robot-12.json", 12, 12, OTHER_ROBOT),
]


# --- small linear algebra on lists of mpf -------------------------------------------------------

def add(a, b):
    return [x + y for x, y in zip(a, b)]


def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def scale(a, k):
    return [x * k for x in a]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b)), mpf(0))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def times(m, v):
    return [dot(row, v) for row in m]


def product(a, b):
    columns = list(zip(*b))
    return [[dot(row, column) for column in columns] for row in a]


def transpose(m):
    return [list(row) for row in zip(*m)]


def derivative(f, x, direction):
    """Central difference of a list-valued function along a direction."""
    ahead = f(add(x, scale(direction, STEP)))
    behind = f(sub(x, scale(direction, STEP)))
    return scale(sub(ahead, behind), 1 / (2 * STEP))


def unit(n, i):
    return [mpf(int(i == j)) for j in range(n)]


def partials(f, x):
    """Matrix of partial derivatives, one column a coordinate."""
    return transpose([derivative(f, x, unit(len(x), i)) for i in range(len(x))])


# --- positions (MODEL.md sections 1 to 4) -------------------------------------------------------

def dh(a, b, alpha, theta):
    """Denavit-Hartenberg in Angeles' form: rotation Q and vector a, both in the frame before."""
    # alpha is 0 or a right angle in Tables 1 and 2: exact values.
    ca, sa = (mpf(1), mpf(0)) if alpha == 0 else (mpf(0), mpf(1))
    c, s = cos(theta), sin(theta)
    q = [[c, -ca * s, sa * s], [s, ca * c, -sa * c], [mpf(0), sa, ca]]
    return q, [a * c, a * s, b]


def chain_frames(links):
    """Origin and rotation of the frame after each joint, from the base of the chain."""
    origin, rotation = [mpf(0)] * 3, [unit(3, i) for i in range(3)]
    frames = []
    for a, b, alpha, theta in links:
        q, vector = dh(a, b, alpha, theta)
        origin = add(origin, times(rotation, vector))
        rotation = product(rotation, q)
        frames.append((origin, rotation))
    return frames


class Robot:
    def __init__(self, params):
        self.crank = mpf(params["crank"])
        self.p4 = [mpf(x) for x in params["p4"]] + [mpf(0)]
        self.bodies = [
            (mpf(b["m"]), [mpf(x) for x in b["com"]], [mpf(x) for x in b["inertia_diag"]])
            for b in params["bodies"]
        ]
        self.viscous = [mpf(x) for x in params["viscous"]]
        self.half_chassis = mpf(params["chassis_mass"]) / 2
        self.wheel_mass = mpf(params["wheel_mass"])
        self.radius = mpf(params["wheel_radius"])
        self.gear = mpf(params["gear_motor"]) * mpf(params["gear_chain"])
        self.axle = mpf(params["wheel_inertia"]) + mpf(params["rotor_inertia"]) * self.gear ** 2
        self.wheel_viscous = mpf(params["wheel_viscous"])
        self.reach = sqrt(dot(self.p4, self.p4))
        self.beta = atan2(self.p4[1], self.p4[0])

    def rpr(self, q):
        """Table 2; frames F2, F3, F4' from O1."""
        theta1, b2, theta3 = q
        return chain_frames([
            (mpf(0), mpf(0), 1, theta1), (mpf(0), b2, 1, pi), (self.crank, mpf(0), 0, theta3),
        ])

    def r2p(self, q):
        """Table 1; frames F5, F6, F7 from O4."""
        theta4, b5, b6 = q
        return chain_frames([
            (mpf(0), mpf(0), 1, theta4), (mpf(0), b5, 1, mpf(0)), (mpf(0), b6, 0, mpf(0)),
        ])

    def joints(self, q):
        """x = [theta1, b2, theta3, theta4, b5, b6] of the closed leg, (A4) and (A1)."""
        b2, b5, b6 = q
        r, l = self.reach, self.crank
        phi = self.beta - acos((r * r + l * l - b2 * b2) / (2 * l * r))
        o3 = [self.p4[0] - l * cos(phi), self.p4[1] - l * sin(phi)]
        theta1 = atan2(o3[0], -o3[1])
        theta1 -= 2 * pi * floor(theta1 / (2 * pi))
        theta3 = phi + pi - theta1
        theta3 -= 2 * pi * floor((theta3 + pi) / (2 * pi))
        return [theta1, b2, theta3, phi + pi / 2, b5, b6]

    def leg_frames(self, q):
        x = self.joints(q)
        # Both chains' base frames are parallel and do not move; O1 is the origin.
        foot = [(add(self.p4, o), r) for o, r in self.r2p(x[3:])]
        return self.rpr(x[:3]) + foot

    def half_frames(self, q):
        """Leg, chassis and wheel of l = [s, b2, b5, b6] in ground axes."""
        ahead = [q[0], mpf(0), mpf(0)]
        level = [unit(3, i) for i in range(3)]
        turn = q[0] / self.radius
        c, s = cos(turn), sin(turn)
        rolling = [[c, mpf(0), s], [mpf(0), mpf(1), mpf(0)], [-s, mpf(0), c]]
        leg = [(add(ahead, o), r) for o, r in self.leg_frames(q[1:])]
        return leg + [(ahead, level), (ahead, rolling)]

    def half_bodies(self):
        still = [mpf(0)] * 3
        wheel = [mpf(0), self.axle, mpf(0)]
        return self.bodies + [
            (self.half_chassis, still, still), (self.wheel_mass, still, wheel),
        ]


# --- dynamics from positions --------------------------------------------------------------------

def places(frames, bodies):
    """Per body twelve numbers: mass centre, then its rotation row by row."""
    out = []
    for (origin, rotation), (_, com, _) in zip(frames, bodies):
        out += add(origin, times(rotation, com))
        out += [x for row in rotation for x in row]
    return out


def rows_of(place):
    return [place[3:6], place[6:9], place[9:12]]


def axial(rate, rotation):
    """Vector of the skew matrix rate * rotation^T."""
    w = product(rate, transpose(rotation))
    return [(w[2][1] - w[1][2]) / 2, (w[0][2] - w[2][0]) / 2, (w[1][0] - w[0][1]) / 2]


class System:
    """Stacked twists of bodies whose positions are a function of q (MODEL.md section 7)."""

    def __init__(self, frames, bodies, q, qd):
        self.bodies, self.q, self.qd, self.n = bodies, q, qd, len(q)
        self.positions = lambda at: places(frames(at), bodies)
        self.t = self.twists(q)
        flat = lambda at: [x for row in self.twists(at) for x in row]
        rates = derivative(flat, q, qd)
        self.t_dot = [rates[i * self.n:(i + 1) * self.n] for i in range(6 * len(bodies))]
        now = self.positions(q)
        self.rotations = [rows_of(now[12 * i:12 * i + 12]) for i in range(len(bodies))]

    def twists(self, q):
        """T, 6r rows: angular velocity and velocity of each mass centre per rate."""
        now, columns = self.positions(q), []
        for i in range(self.n):
            rate = derivative(self.positions, q, unit(self.n, i))
            column = []
            for k in range(0, len(now), 12):
                column += axial(rows_of(rate[k:k + 12]), rows_of(now[k:k + 12]))
                column += rate[k:k + 3]
            columns.append(column)
        return transpose(columns)

    def blocks(self, m):
        return [m[i:i + 6] for i in range(0, len(m), 6)]

    def inertia_of(self, i):
        mass, _, principal = self.bodies[i]
        r = self.rotations[i]
        spread = [[r[a][k] * principal[k] for k in range(3)] for a in range(3)]
        return mass, product(spread, transpose(r))

    def inertia_and_coriolis(self, t_dot):
        n = self.n
        inertia = [[mpf(0)] * n for _ in range(n)]
        coriolis = [[mpf(0)] * n for _ in range(n)]
        for i, (t, td) in enumerate(zip(self.blocks(self.t), self.blocks(t_dot))):
            mass, about = self.inertia_of(i)
            columns, rates = transpose(t), transpose(td)
            omega = [dot(row, self.qd) for row in t[:3]]
            for b in range(n):
                spin, slide = times(about, columns[b][:3]), scale(columns[b][3:], mass)
                # M T_dot + W M T, with W = diag(omega x, 0)
                bias = add(times(about, rates[b][:3]), cross(omega, spin))
                push = scale(rates[b][3:], mass)
                for a in range(n):
                    inertia[a][b] += dot(columns[a][:3], spin) + dot(columns[a][3:], slide)
                    coriolis[a][b] += dot(columns[a][:3], bias) + dot(columns[a][3:], push)
        return inertia, coriolis

    def gravity(self, g):
        force = [mpf(0)] * self.n
        for i, t in enumerate(self.blocks(self.t)):
            pull = scale(g, self.bodies[i][0])
            force = add(force, [dot(column[3:], pull) for column in transpose(t)])
        return force

    def potential(self, q, g):
        place = self.positions(q)
        return -sum(b[0] * dot(g, place[12 * i:12 * i + 3]) for i, b in enumerate(self.bodies))

    def kinetic(self, q, qd):
        """From positions alone, by the rate of each body's place."""
        place, rate = self.positions(q), derivative(self.positions, q, qd)
        energy = mpf(0)
        for i, (mass, _, principal) in enumerate(self.bodies):
            at = slice(12 * i, 12 * i + 12)
            r, rd = rows_of(place[at]), rows_of(rate[at])
            velocity, omega = rate[at][:3], axial(rd, r)
            inner = times(transpose(r), omega)
            energy += mass * dot(velocity, velocity) / 2
            energy += sum(j * w * w for j, w in zip(principal, inner)) / 2
        return energy

    def lagrange(self, qdd):
        """d/dt dT/dqd - dT/dq by nested differences: a second way to I qdd + C qd.

        Steps of 1e-9 with 60 digits: truncation near 1e-18, far below double precision.
        """
        h, n = mpf(10) ** -9, self.n

        def kinetic(q, qd):
            return self.kinetic(q, qd)

        def momentum(t, a):
            q = [x + v * t + c * t * t / 2 for x, v, c in zip(self.q, self.qd, qdd)]
            v = [v + c * t for v, c in zip(self.qd, qdd)]
            e = scale(unit(n, a), h)
            return (kinetic(q, add(v, e)) - kinetic(q, sub(v, e))) / (2 * h)

        force = []
        for a in range(n):
            e = scale(unit(n, a), h)
            rate = (momentum(h, a) - momentum(-h, a)) / (2 * h)
            slope = (kinetic(add(self.q, e), self.qd) - kinetic(sub(self.q, e), self.qd)) / (2 * h)
            force.append(rate - slope)
        return force


def agree(what, a, b, within):
    worst = max(abs(x - y) for x, y in zip(a, b))
    if not worst <= within:
        raise SystemExit(f"{what}: two ways differ by {mp.nstr(worst, 3)}: {a} {b}")


# --- the file -----------------------------------------------------------------------------------

def doubles(value):
    """Rounded to double once; minus zero becomes zero."""
    if isinstance(value, (list, tuple)):
        return [doubles(item) for item in value]
    number = float(value)
    # Differences leave 1e-40 where the truth is zero.
    return 0.0 if abs(number) < 1e-25 else number


def twist_parts(position, angle, q, qd, qdd):
    """J, twist and its derivative of a point with a yaw angle, from positions."""
    pose = lambda at: [mpf(0), mpf(0), angle(at)] + position(at)
    jacobian = partials(pose, q)
    twist = times(jacobian, qd)
    flat = lambda at: [x for row in partials(pose, at) for x in row]
    rate = derivative(flat, q, qd)
    n = len(q)
    bias = [dot(rate[i * n:i * n + n], qd) for i in range(6)]
    return jacobian, twist, add(times(jacobian, qdd), bias)


def chain_case(robot, frames, bodies, angle, q, qd, qdd, g):
    q, qd, qdd = ([mpf(x) for x in v] for v in (q, qd, qdd))
    point = lambda at: frames(at)[2][0]
    jacobian, twist, twist_dot = twist_parts(point, angle, q, qd, qdd)
    system = System(frames, bodies, q, qd)
    inertia, coriolis = system.inertia_and_coriolis(system.t_dot)
    c_qd, tau_g = times(coriolis, qd), system.gravity(g)
    tau_l = add(times(inertia, qdd), c_qd)
    agree("chain, Lagrange", tau_l, system.lagrange(qdd), mpf(10) ** -14)
    return {
        "q": q, "qd": qd, "qdd": qdd, "p": point(q), "J": jacobian, "twist": twist,
        "twist_dot": twist_dot, "T": system.t, "Tdot": system.t_dot, "I": inertia,
        "C": coriolis, "C_qd": c_qd, "tau_g": tau_g, "tau": sub(tau_l, tau_g),
    }


def printed_t_dot(robot, x, xd, n, n_dot):
    """Derivative of T of the leg with the printed (58) and (64): no slide rates in r_dot."""
    k = [mpf(0), mpf(0), mpf(1)]
    u = [sin(x[0]), -cos(x[0]), mpf(0)]
    f = [sin(x[3]), -cos(x[3]), mpf(0)]
    rows = []
    chains = [
        (robot.rpr, robot.bodies[:3], 0, [[mpf(0)] * 3, scale(u, xd[1]), scale(u, xd[1])]),
        (robot.r2p, robot.bodies[3:], 3, [
            [mpf(0)] * 3, scale(f, xd[4]), sub(scale(f, xd[4]), scale(k, xd[5])),
        ]),
    ]
    for frames, bodies, row, slides in chains:
        chain = System(frames, bodies, x[row:row + 3], xd[row:row + 3])
        t_dot = [list(r) for r in chain.t_dot]
        for i, slide in enumerate(slides):
            lost = cross(k, slide)
            for a in range(3):
                t_dot[6 * i + 3 + a][0] -= lost[a]
        part, part_dot = n[row:row + 3], n_dot[row:row + 3]
        whole = [add(a, b) for a, b in zip(product(t_dot, part), product(chain.t, part_dot))]
        rows += whole
    return rows


def leg_case(robot, q, qd, qdd, g, contact):
    q, qd, qdd = ([mpf(x) for x in v] for v in (q, qd, qdd))
    x = robot.joints(q)
    n = partials(robot.joints, q)
    flat = lambda at: [v for row in partials(robot.joints, at) for v in row]
    rate = derivative(flat, q, qd)
    n_dot = [rate[3 * i:3 * i + 3] for i in range(6)]
    xd = times(n, qd)
    xdd = add(times(n, qdd), times(n_dot, qd))
    # The tip of the open chain stays at O4.
    agree("closure", robot.rpr(x[:3])[2][0], robot.p4, AGREE)
    foot = lambda at: robot.r2p(robot.joints(at)[3:])[2][0]
    jacobian, twist, twist_dot = twist_parts(foot, lambda at: robot.joints(at)[3], q, qd, qdd)
    # (A5), both branches
    roots = []
    for sign in (1, -1):
        theta1 = robot.beta + sign * acos(-robot.crank * cos(x[2]) / robot.reach)
        theta1 -= 2 * pi * floor(theta1 / (2 * pi))
        b2 = robot.p4[0] * sin(theta1) - robot.p4[1] * cos(theta1) - robot.crank * sin(x[2])
        roots.append([theta1, b2])
    agree("(A5)", roots[0], x[:2], AGREE)
    system = System(robot.leg_frames, robot.bodies, q, qd)
    inertia, coriolis = system.inertia_and_coriolis(system.t_dot)
    c_qd, tau_g = times(coriolis, qd), system.gravity(g)
    tau_l = add(times(inertia, qdd), c_qd)
    agree("leg, Lagrange", tau_l, system.lagrange(qdd), mpf(10) ** -14)
    potential = lambda at: [system.potential(at, g)]
    slope = [-derivative(potential, q, unit(3, i))[0] for i in range(3)]
    agree("gravity", tau_g, slope, AGREE)
    tau_d = [-d * v for d, v in zip(robot.viscous, qd)]
    push = times(transpose(jacobian[3:]), contact)
    _, c_printed = system.inertia_and_coriolis(printed_t_dot(robot, x, xd, n, n_dot))
    return {
        "q": q, "qd": qd, "qdd": qdd, "joints": x, "joints_d": xd, "joints_dd": xdd,
        "foot_p": foot(q), "foot_v": twist[3:], "foot_a": twist_dot[3:],
        "foot_p_f1": add(robot.p4, foot(q)), "N": n, "Ndot": n_dot, "theta1_roots": roots,
        "I": inertia, "C": coriolis, "C_qd": c_qd, "tau_g": tau_g, "tau_d": tau_d,
        "contact_force": contact, "tau_a": sub(sub(sub(tau_l, tau_g), tau_d), push),
        "tau_l": tau_l,
        "tau_l_printed_58_64": add(times(inertia, qdd), times(c_printed, qd)),
    }


def half_case(robot, q, qd, qdd, g, contact):
    q, qd, qdd = ([mpf(x) for x in v] for v in (q, qd, qdd))
    system = System(robot.half_frames, robot.half_bodies(), q, qd)
    inertia, coriolis = system.inertia_and_coriolis(system.t_dot)
    c_qd, tau_g = times(coriolis, qd), system.gravity(g)
    tau_l = add(times(inertia, qdd), c_qd)
    agree("half robot, Lagrange", tau_l, system.lagrange(qdd), mpf(10) ** -14)
    viscous = [robot.wheel_viscous] + robot.viscous
    tau_d = [-d * v for d, v in zip(viscous, qd)]
    foot = lambda at: add([at[0], mpf(0), mpf(0)], robot.r2p(robot.joints(at[1:])[3:])[2][0])
    push = times(transpose(partials(foot, q)), contact)
    return {
        "q": q, "qd": qd, "qdd": qdd, "I": inertia, "C": coriolis, "C_qd": c_qd,
        "tau_g": tau_g, "contact_force": contact,
        "tau_a": sub(sub(sub(tau_l, tau_g), tau_d), push),
    }


def strokes(params):
    """Lengths between which states are drawn: as section 9 for the paper's crank loop, and the
    part of the loop with a good moment arm for any other."""
    reach = (params["p4"][0] ** 2 + params["p4"][1] ** 2) ** 0.5
    middle = (reach ** 2 - params["crank"] ** 2) ** 0.5
    return middle - 0.09, middle + 0.09


def case(robot, params, rng, number):
    span = lambda *ranges: [rng.uniform(low, high) for low, high in ranges]
    tilt = span((-4.0, 4.0), (-4.0, 4.0), (-9.81, -6.0)) if number % 3 else [0.0, 0.0, -9.81]
    g = [mpf(x) for x in tilt]
    low, high = strokes(params)
    leg_q = span((low, high), (0.01, 0.19), (0.01, 0.19))
    leg_qd, leg_qdd = span(*[(-0.4, 0.4)] * 3), span(*[(-6.0, 6.0)] * 3)
    contact = [mpf(x) for x in span((-20.0, 20.0), (-20.0, 20.0), (0.0, 40.0))]
    r2p_q = span((1.0, 2.1), (0.01, 0.25), (0.01, 0.25))
    rpr_q = span((2.7, 3.6), (0.25, 0.55), (-0.5, 0.5))
    rates, accelerations = [(-1.2, 1.2), (-0.4, 0.4), (-0.4, 0.4)], [(-10, 10), (-6, 6), (-6, 6)]
    turning, bending = [(-1.2, 1.2), (-0.4, 0.4), (-1.2, 1.2)], [(-8, 8), (-6, 6), (-8, 8)]

    foot = chain_case(robot, robot.r2p, robot.bodies[3:], lambda q: q[0],
                      r2p_q, span(*rates), span(*accelerations), g)
    qd, qdd, zero = foot["qd"], foot["qdd"], mpf(0)
    foot["twist_printed_13"] = [zero, zero, -qd[0], qd[1], zero, -qd[2]]
    foot["twist_dot_printed_16"] = [zero, zero, qdd[0], qdd[1], 2 * qd[0] * qd[1], -qdd[2]]

    yaw = chain_case(robot, robot.rpr, robot.bodies[:3], lambda q: q[0] + q[2] - pi,
                     rpr_q, span(*turning), span(*bending), g)
    q, qd, qdd = yaw["q"], yaw["qd"], yaw["qdd"]
    s3, c3 = robot.crank * sin(q[2]), robot.crank * cos(q[2])
    w, a = qd[0] + qd[2], qdd[0] + qdd[2]
    yaw["twist_printed_32"] = [zero, zero, w, -s3 * w, c3 * w, zero]
    yaw["twist_dot_printed_38"] = [
        zero, zero, a, -s3 * a - (qd[0] * qd[1] + c3 * w * w), qdd[1] + c3 * a + s3 * w * w, zero,
    ]

    travel = span((-1.0, 1.0)), span((-0.5, 0.5)), span((-2.0, 2.0))
    half = half_case(robot, travel[0] + leg_q, travel[1] + leg_qd, travel[2] + leg_qdd, g, contact)
    leg = leg_case(robot, leg_q, leg_qd, leg_qdd, g, contact)
    return {"id": number, "gravity": g, "r2p": foot, "rpr": yaw, "leg": leg, "half_robot": half}


def rounded(value):
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return value if isinstance(value, int) else doubles(value)


def make(seed, count, params):
    robot, rng = Robot(params), random.Random(seed)
    total = 2 * (robot.half_chassis + robot.wheel_mass + sum(b[0] for b in robot.bodies))
    k1 = -(pi / 2 + robot.beta)
    derived = {
        "mass_total": total, "R": robot.reach, "beta": robot.beta, "k1": k1, "k4": k1,
        "gear": robot.gear, "half_wheel_inertia": robot.axle,
    }
    return {
        "schema": "wheeleg-reference-vectors/1",
        "seed": seed,
        "units": "SI, rad",
        "params": {**params, **rounded(derived)},
        "cases": [rounded(case(robot, params, rng, i)) for i in range(count)],
    }


def write(path, seed, count, params):
    with open(path, "w", encoding="utf-8") as out:
        json.dump(make(seed, count, params), out, separators=(",", ":"))
        out.write("\n")


def main():
    parser = argparse.ArgumentParser(description="Write reference vectors.")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--robot", choices=["wheeleg-2003", "other"], default="wheeleg-2003")
    parser.add_argument("--out")
    args = parser.parse_args()
    if (args.seed is None) != (args.out is None):
        parser.error("--seed and --out go together")
    if args.seed is None:
        for path, seed, count, params in FILES:
            write(path, seed, count, params)
    else:
        robot = WHEELEG_2003 if args.robot == "wheeleg-2003" else OTHER_ROBOT
        write(args.out, args.seed, args.cases, robot)


if __name__ == "__main__":
    main()

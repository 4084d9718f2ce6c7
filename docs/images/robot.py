"""Draws the robot from its robot file: docs/images/robot.svg.

    python3 docs/images/robot.py host-sim/robots/wheeleg-2003.toml docs/images/robot.svg

Joints, strokes, crank, wheels, track and soles have the dimensions of the robot file. The shape
of the chassis, of the brackets and of what stands on the deck is free. The view is oblique: x
(forward) and z (up) are true to scale, y (left) goes to the right and up at a reduced scale.
Needs Python 3.11 or newer, nothing else. `--theme light` or `dark` writes one palette only, for
programs that do not follow `prefers-color-scheme`.
"""

import math
import sys
import tomllib

LIGHT = {
    "panel": "#F4F6F7", "line": "#CDD3D8", "ink": "#161B20", "ink2": "#414B54", "body": "#DDE2E6",
    "top": "#EDF0F2", "end": "#CAD1D7", "edge": "#7C8790", "barrel": "#AEB7BF", "hi": "#D5DBE0",
    "rod": "#5E6972", "cap": "#9BA6AE", "tyre": "#3A4249", "rim": "#C3CBD1", "ground": "#E1E5E8",
    "mark": "#0072B2", "sole": "#161B20",
}
DARK = {
    "panel": "#181D21", "line": "#2E373E", "ink": "#ECEFF1", "ink2": "#B7C1C9", "body": "#2E373E",
    "top": "#3A444C", "end": "#262E34", "edge": "#75818B", "barrel": "#5B6770", "hi": "#7D8A94",
    "rod": "#C3CCD3", "cap": "#A9B4BC", "tyre": "#0A0D0F", "rim": "#4B565F", "ground": "#222A2F",
    "mark": "#56B4E9", "sole": "#ECEFF1",
}
# Class: (fill, stroke, stroke width); "-" is none.
CLASSES = {
    "panel": ("panel", "line", 2), "ground": ("ground", "-", 0), "tick": ("-", "line", 2),
    "body": ("body", "edge", 1.5), "top": ("top", "edge", 1.5), "end": ("end", "edge", 1.5),
    "seam": ("-", "edge", 1), "tyre": ("tyre", "edge", 1.5), "rim": ("rim", "edge", 1),
    "spoke": ("end", "edge", 1), "hub": ("barrel", "edge", 1), "rodf": ("rod", "-", 0),
    "barrel": ("barrel", "edge", 1.5), "hi": ("hi", "-", 0), "cap": ("cap", "edge", 1),
    "sole": ("sole", "-", 0), "barrell": ("-", "barrel", 24), "barrele": ("-", "edge", 27),
    "hil": ("-", "hi", 6), "rodl": ("-", "rod", 9), "crank": ("-", "edge", 15),
    "tank": ("-", "barrel", 74), "tankhi": ("-", "hi", 12), "tyrel": ("-", "tyre", 300),
    "axle": ("-", "edge", 26), "lead": ("-", "mark", 2.5), "dot": ("mark", "-", 0),
    "dim": ("-", "ink2", 2), "text": ("ink", "-", 0), "note": ("ink2", "-", 0),
}
DEPTH, RISE = 0.26, 0.20


def ob(x, y, z):
    """A point of the robot (mm; x forward, y left, z up, origin below the axle) on the page."""
    return (round(x + DEPTH * y, 1), round(-(z + RISE * y), 1))


class Page:
    def __init__(self):
        self.out = []

    def tag(self, name, cls, **attributes):
        text = " ".join(f'{k.replace("_", "-")}="{v}"' for k, v in attributes.items())
        self.out.append(f'<{name} class="{cls}" {text}/>')

    def poly(self, cls, points):
        self.tag("polygon", cls, points=" ".join(f"{x},{y}" for x, y in points))

    def line(self, cls, a, b, cap="butt"):
        self.tag("line", cls, x1=a[0], y1=a[1], x2=b[0], y2=b[1], stroke_linecap=cap)

    def rect(self, cls, x, y, w, h, r=0):
        self.tag("rect", cls, x=round(x, 1), y=round(y, 1), width=round(w, 1), height=round(h, 1), rx=r)

    def text(self, cls, x, y, text, size, anchor="start", weight=400):
        self.out.append(
            f'<text class="{cls}" x="{x}" y="{y}" font-size="{size}" text-anchor="{anchor}" '
            f'font-weight="{weight}">{text}</text>'
        )


class Robot:
    def __init__(self, file):
        with open(file, "rb") as f:
            r = tomllib.load(f)
        mm = lambda v: v * 1000.0
        body, spatial = r["body"], r["spatial"]
        self.crank = mm(body["crank"]["value"])
        self.p4 = [mm(v) for v in body["p4"]["value"]]
        self.zero = [mm(v) for v in body["stroke_zero"]["value"]]
        o4 = [mm(v) for v in body["o4"]["value"]]
        self.radius = mm(body["wheel_radius"]["value"])
        self.o4 = [o4[0], o4[1], o4[2] + self.radius]
        self.pad = mm(body["foot_pad"]["value"])
        self.track = mm(spatial["track"]["value"])
        self.width = mm(spatial["wheel_width"]["value"])
        self.sole = r["contact"]["sole_radius"]["value"]
        self.stroke = r["cylinder"]["stroke"]["value"]
        supply, ambient = r["supply"], r["gas"]["ambient_pressure"]["value"]
        self.reservoir = supply["reservoir"]["value"]
        self.gauge = (supply["set_pressure"]["value"] - ambient) / 1e5

    def leg(self, side, s2, s5, s6):
        """Points of one leg; side is +1 left, -1 right; strokes in mm (MODEL.md, (A4))."""
        reach, b2 = math.hypot(*self.p4), s2 + self.zero[0]
        cosine = (reach**2 + self.crank**2 - b2**2) / (2 * self.crank * reach)
        phi = math.atan2(self.p4[1], self.p4[0]) - math.acos(cosine)
        ox, oy, oz = self.o4
        b5, b6 = s5 + self.zero[1], s6 + self.zero[2]
        c, s = math.cos(phi), math.sin(phi)
        at = lambda w: (ox + w * c, side * (oy + w * s))
        return {
            "o4": (ox, side * oy), "o1": (ox - self.p4[0], side * (oy - self.p4[1])),
            "o3": at(-self.crank), "at": at, "o6": at(b5), "sole": oz - b6 - self.pad,
        }


def wheel(p, robot, y):
    r, w = robot.radius, robot.width / 2
    a, b = ob(0, y + w, r), ob(0, y - w, r)
    p.line("tyrel", a, b, "round")
    cx, cy = b
    p.tag("circle", "tyre", cx=cx, cy=cy, r=r - 4)
    p.tag("circle", "rim", cx=cx, cy=cy, r=r - 38)
    for i in range(5):
        p.out.append(
            f'<path class="spoke" d="M-9,-26 L-13,-106 A107,107 0 0 1 13,-106 L9,-26Z" '
            f'transform="translate({cx},{cy}) rotate({i * 72 + 20})"/>'
        )
    p.tag("circle", "hub", cx=cx, cy=cy, r=27)
    p.tag("circle", "rodf", cx=cx, cy=cy, r=9)


def assembly(p, robot, q):
    """Vertical cylinder on its carriage, rod and foot."""
    x, y = ob(*q["o6"], 0)
    sole = q["sole"]
    p.rect("rodf", x - 4, y - 206, 8, 206 - sole - 30)
    p.rect("top", x - 24, y - 338, 48, 62, 5)
    p.rect("barrel", x - 12, y - 400, 24, 200, 2)
    p.rect("hi", x - 7, y - 396, 5, 192)
    p.rect("cap", x - 15, y - 404, 30, 14, 2.5)
    p.rect("cap", x - 15, y - 212, 30, 14, 2.5)
    f = y - sole
    p.poly("barrel", [(x - 8, f - 34), (x + 8, f - 34), (x + 17, f - 13), (x - 17, f - 13)])
    p.rect("sole", x - robot.sole, f - 14, 2 * robot.sole, 14, 5)
    return x, y


def draw(robot):
    p = Page()
    left = robot.leg(1, 90, 150, 60)  # swings
    right = robot.leg(-1, 90, 90, robot.stroke)  # stands
    p.rect("panel", -600, -585, 1680, 700, 14)
    p.poly("ground", [ob(-420, 420, 0), ob(860, 420, 0), ob(1070, -400, 0), ob(-210, -400, 0)])
    for x in range(-200, 801, 200):
        p.line("tick", ob(x, 420, 0), ob(x, -400, 0))
    wheel(p, robot, robot.track / 2)
    # Chassis: one profile, extruded across. Its shape is free.
    rear, front, belly, deck, h = -290, 560, 120, 262, 190
    p.poly("end", [ob(front, -h, 196), ob(front, h, 196), ob(front, h, deck), ob(front, -h, deck)])
    p.poly("end", [ob(430, -h, belly), ob(430, h, belly), ob(front, h, 196), ob(front, -h, 196)])
    p.poly("top", [ob(rear, -h, deck), ob(front, -h, deck), ob(front, h, deck), ob(rear, h, deck)])
    x0, x1, y0, y1, z0, z1 = -70, 230, -120, 120, 262, 296
    p.poly("end", [ob(x1, y0, z0), ob(x1, y1, z0), ob(x1, y1, z1), ob(x1, y0, z1)])
    p.poly("top", [ob(x0, y0, z1), ob(x1, y0, z1), ob(x1, y1, z1), ob(x0, y1, z1)])
    p.poly("body", [ob(x0, y0, z0), ob(x1, y0, z0), ob(x1, y0, z1), ob(x0, y0, z1)])
    for i in range(8):
        x, y = ob(-46 + i * 34, -120, 279)
        p.tag("circle", "hub", cx=x, cy=y, r=5)
    p.line("tank", ob(-222, -110, 296), ob(-222, 110, 296), "round")
    p.line("tankhi", ob(-232, -100, 316), ob(-232, 100, 316), "round")
    profile = [(rear, 168), (rear + 46, belly), (430, belly), (front, 196), (front, deck), (rear, deck)]
    p.poly("body", [ob(x, -h, z) for x, z in profile])
    p.line("seam", ob(rear + 20, -h, 236), ob(front - 16, -h, 236))
    p.line("axle", ob(0, -190, robot.radius), ob(0, -262, robot.radius))
    # Yaw cylinders cross the chassis, one above the other: barrel from O1, rod to the crank at O3.
    for q, z in ((left, 288), (right, 312)):
        (ax, ay), (bx, by) = q["o1"], q["o3"]
        n = math.hypot(bx - ax, by - ay)
        along = lambda w: (ax + (bx - ax) * w / n, ay + (by - ay) * w / n)
        p.line("rodl", ob(*along(225), z), ob(bx, by, z))
        p.line("barrele", ob(ax, ay, z), ob(*along(225), z))
        p.line("barrell", ob(ax, ay, z), ob(*along(225), z))
    for q, side in ((left, 1), (right, -1)):
        y = side * robot.o4[1]
        inner = side * (robot.o4[1] - 50)
        p.poly("end", [ob(520, inner, 262), ob(556, inner, 262), ob(618, y, 280), ob(582, y, 280)])
        x, _ = ob(robot.o4[0], y, 0)
        base = ob(robot.o4[0], y, 0)[1]
        p.rect("end", x - 17, base - 346, 34, 66, 4)
        p.line("crank", ob(*q["o3"], 300), ob(*q["o4"], 300), "round")
        at = q["at"]
        p.line("rodl", ob(*at(-8), 318), ob(*q["o6"], 318))
        p.line("barrele", ob(*at(-225), 318), ob(*at(-8), 318))
        p.line("barrell", ob(*at(-224), 318), ob(*at(-9), 318))
        p.line("hil", ob(*at(-221), 322), ob(*at(-12), 322))
        x, y = ob(*q["o3"], 300)
        p.tag("circle", "rodf", cx=x, cy=y, r=10)
        assembly(p, robot, q)
    wheel(p, robot, -robot.track / 2)
    labels(p, robot, left, right)
    return p


def labels(p, robot, left, right):
    def note(at, to, name, what, anchor="start"):
        p.line("lead", at, to)
        p.tag("circle", "dot", cx=at[0], cy=at[1], r=5)
        dx = 10 if anchor == "start" else -10
        p.text("text", to[0] + dx, to[1] - 4, name, 25, anchor, 600)
        p.text("note", to[0] + dx, to[1] + 23, what, 21, anchor)

    stroke = f"{robot.stroke:g} mm stroke"
    (ax, ay), (bx, by) = right["o1"], right["o3"]
    mid = ob(ax + (bx - ax) * 0.3, ay + (by - ay) * 0.3, 312)
    note(mid, (mid[0], -520), "Yaw cylinder, b2", f"turns the leg, {stroke}", "end")
    p5 = ob(*left["at"](-110), 318)
    note(p5, (p5[0] + 20, -520), "Horizontal cylinder, b5", f"reaches forward, {stroke}")
    x6, y6 = ob(*left["o6"], 0)
    note((x6 + 12, y6 - 240), (x6 + 52, y6 - 240), "Vertical", "cylinder, b6")
    note((x6 + 24, y6 - left["sole"] - 7), (x6 + 52, y6 - left["sole"] - 7), "Foot", "four switches")
    wx, wy = ob(0, -robot.track / 2 - robot.width / 2, robot.radius)
    note((wx - 128, wy), (wx - 250, wy), "Driven wheel", f"radius {robot.radius:g} mm", "end")
    tx, ty = ob(-222, -110, 296)
    note((tx - 10, ty - 20), (tx - 10, -520), "Air reservoir", f"{robot.reservoir:g} litres, {robot.gauge:g} bar", "end")
    ex, ey = ob(0, 0, 296)
    note((ex, ey), (ex, -520), "Boards", "six joints, two wheels", "end")
    # A scale; its zero has no meaning.
    z = 60
    xa, xb = -200, 800
    p.line("dim", (xa, z), (xb, z))
    for i, x in enumerate(range(xa, xb + 1, 200)):
        p.line("dim", (x, z - 8), (x, z + 8))
        p.text("note", x, z + 32, f"{i * 0.2:.1f}" + (" m" if i == 0 else ""), 20, "middle")


def rules(palette):
    out = []
    for name, (fill, stroke, width) in CLASSES.items():
        f = "none" if fill == "-" else palette[fill]
        s = "none" if stroke == "-" else palette[stroke]
        out.append(f".{name}{{fill:{f};stroke:{s};stroke-width:{width}}}")
    return "\n".join(out)


def svg(robot, theme):
    page = draw(robot)
    style = rules(DARK if theme == "dark" else LIGHT)
    if theme == "both":
        style += "\n@media (prefers-color-scheme: dark){\n" + rules(DARK) + "\n}"
    head = (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="-605 -590 1690 710" role="img" '
        'font-family="system-ui,-apple-system,Segoe UI,Roboto,DejaVu Sans,sans-serif" '
        'stroke-linejoin="round">\n'
        "<!-- Made by docs/images/robot.py from the robot file. Do not edit by hand. -->\n"
        "<title>Wheeleg from its right side: chassis, two driven rear wheels and two front legs, "
        "each with a yaw, a horizontal and a vertical pneumatic cylinder</title>\n"
    )
    return head + f"<style>\n{style}\n</style>\n" + "\n".join(page.out) + "\n</svg>\n"


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    theme = sys.argv[sys.argv.index("--theme") + 1] if "--theme" in sys.argv else "both"
    if theme != "both":
        arguments.remove(theme)
    source, target = arguments
    with open(target, "w", encoding="utf-8") as f:
        f.write(svg(Robot(source), theme))


if __name__ == "__main__":
    main()

"""Draws what the campaign `leg-design` found: docs/images/leg-design.svg.

    python3 docs/images/leg-design.py cases.parquet host-sim/campaigns/leg-design.sql docs/images/leg-design.svg

Left: each leg by its conditioning and the air that it takes for a metre of the design terrains.
Right: the picked leg and the paper's on every terrain. Needs DuckDB.
"""

import sys

import duckdb

STYLE = """
text { font: 13px sans-serif; fill: #161B20 } .note { fill: #414B54 } .axis { stroke: #9BA6AE }
.grid { stroke: #E1E5E8 } .b0 { fill: #0072B2; stroke: #0072B2 } .b1 { fill: #E69F00; stroke: #E69F00 }
.b2 { fill: #CC3D7A; stroke: #CC3D7A } .open { fill-opacity: 0 } .ring { fill: none; stroke: #161B20 }
.link { stroke: #9BA6AE; stroke-width: 2 } .panel { fill: #F4F6F7 }
@media (prefers-color-scheme: dark) {
text { fill: #ECEFF1 } .note { fill: #B7C1C9 } .grid { stroke: #2E373E } .ring { stroke: #ECEFF1 }
.panel { fill: #181D21 } }
"""
LEFT, RIGHT, TOP, BOTTOM = (70, 410), (620, 860), 56, 356


def scale(values, place):
    low, high = min(values), max(values)
    room = 0.08 * (high - low or 1)
    low, high = low - room, high + room
    a, b = place
    return (lambda v: a + (b - a) * (v - low) / (high - low)), low, high


def ticks(low, high):
    step = next(s for s in (0.1, 0.2, 0.5, 1, 2, 5, 10) if (high - low) / s <= 7)
    first = int(low / step) + 1
    return [i * step for i in range(first, int(high / step) + 1)]


def text(x, y, words, anchor="start", kind=""):
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" class="{kind}">{words}</text>'


def dot(x, y, kind, r=5):
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r}" class="{kind}"/>'


def legs_panel(legs, picked):
    most = max(leg["met"] for leg in legs)
    x, *xs = scale([leg["conditioning"] for leg in legs], LEFT)
    y, *ys = scale([leg["air_dm3_m"] for leg in legs], (BOTTOM, TOP))
    out = [text(LEFT[0], 24, "36 legs on the design terrains")]
    for v in ticks(*ys):
        out.append(f'<path d="M{LEFT[0]} {y(v):.1f}H{LEFT[1]}" class="grid"/>')
        out.append(text(LEFT[0] - 8, y(v) + 4, f"{v:g}", "end", "note"))
    for v in ticks(*xs):
        out.append(text(x(v), BOTTOM + 20, f"{v:g}", "middle", "note"))
    out.append(text(sum(LEFT) / 2, BOTTOM + 40, "conditioning", "middle", "note"))
    out.append(text(16, 44, "air, dm³ ANR a metre", kind="note"))
    bores = sorted({leg["bore"] for leg in legs})
    for leg in legs:
        kind = f'b{bores.index(leg["bore"])}' + ("" if leg["met"] == most else " open")
        at = x(leg["conditioning"]), y(leg["air_dm3_m"])
        out.append(dot(*at, kind))
        same = all(leg[k] == picked[k] for k in ("crank", "radius_mm", "hip_mm", "bore"))
        for is_it, name in ((leg["paper"], "paper"), (same, "picked")):
            if is_it:
                out += [dot(*at, "ring", 9), text(at[0] + 13, at[1] + 4, name)]
    for i, bore in enumerate(bores):
        out += [dot(LEFT[0] + 6 + 110 * i, BOTTOM + 64, f"b{i}"),
                text(LEFT[0] + 17 + 110 * i, BOTTOM + 68, f"{20 * bore:g} mm bore", kind="note")]
    out.append(text(LEFT[0], BOTTOM + 90, "hollow: fewer cases passed than of the best", kind="note"))
    return out


def terrains_panel(rows):
    terrains = list(dict.fromkeys((row["terrain"], row["design"]) for row in rows))
    x, *xs = scale([row["air_dm3_m"] for row in rows if row["air_dm3_m"] is not None], RIGHT)
    out = [text(RIGHT[0] - 130, 24, "the picked leg and the paper's, terrain by terrain")]
    for v in ticks(*xs):
        out.append(f'<path d="M{x(v):.1f} {TOP}V{BOTTOM}" class="grid"/>')
        out.append(text(x(v), BOTTOM + 20, f"{v:g}", "middle", "note"))
    out.append(text(sum(RIGHT) / 2, BOTTOM + 40, "air, dm³ ANR a metre", "middle", "note"))
    for i, (terrain, design) in enumerate(terrains):
        y = TOP + 26 + i * (BOTTOM - TOP - 26) / len(terrains) + (14 if not design else 0)
        both = {row["leg"]: row for row in rows if row["terrain"] == terrain}
        ends = {leg: x(row["air_dm3_m"]) for leg, row in both.items() if row["air_dm3_m"] is not None}
        if len(ends) == 2:
            a, b = ends.values()
            out.append(f'<path d="M{a:.1f} {y:.1f}H{b:.1f}" class="link"/>')
        for leg, at in ends.items():
            whole = both[leg]["met"] == both[leg]["cases"]
            out.append(dot(at, y, ("b2" if leg == "paper" else "b0") + ("" if whole else " open")))
        out.append(text(RIGHT[0] - 14, y + 4, terrain, "end"))
        if i == 0 or design != terrains[i - 1][1]:
            out.append(text(RIGHT[0] - 130, y - 16, "design" if design else "held out", kind="note"))
    for i, (leg, kind) in enumerate((("paper", "b2"), ("picked", "b0"))):
        out += [dot(RIGHT[0] + 6 + 90 * i, BOTTOM + 64, kind),
                text(RIGHT[0] + 17 + 90 * i, BOTTOM + 68, leg, kind="note")]
    out.append(text(RIGHT[0] - 130, BOTTOM + 90, "hollow: not all machines passed", kind="note"))
    return out


def main() -> int:
    table, sql, picture = sys.argv[1:]
    connection = duckdb.connect()
    connection.execute(f"SET VARIABLE cases = '{table}'")
    with open(sql, encoding="utf-8") as file:
        statements = duckdb.extract_statements(file.read())

    def rows(query):
        found = connection.execute(query)
        names = [column[0] for column in found.description]
        return [dict(zip(names, row)) for row in found.fetchall()]

    answers = [rows(statement) for statement in statements]
    by_terrain = next(a for a in answers if a and "terrain" in a[0])
    (picked,) = rows("SELECT * FROM picked")
    body = legs_panel(rows("SELECT * FROM legs"), picked) + terrains_panel(by_terrain)
    box = f'<rect width="900" height="{BOTTOM + 106}" class="panel"/>'
    svg = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 {BOTTOM + 106}">'
           f"<style>{STYLE}</style>{box}\n" + "\n".join(body) + "\n</svg>\n")
    with open(picture, "w", encoding="utf-8") as file:
        file.write(svg)
    return 0


if __name__ == "__main__":
    sys.exit(main())

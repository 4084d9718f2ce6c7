"""Draws how-steep.png: how often and how fast the robot climbs, by ground, nails and law.

    python3 how-steep.py cases.parquet      # the table of `wheeleg campaign merge` of how-steep
"""

import sys
from pathlib import Path

import duckdb
import matplotlib.pyplot as plt

GROUNDS = ["rock", "firm-sand", "volcanic-sand", "dry-sand", "loose-ash"]
LAWS = {0: "paper's law", 5: "predictive law"}
NAILS = {15: ":", 60: "-"}
COLOURS = {0: "#c2571a", 5: "#1f6f8b"}
BAR_MM_S = 20

QUERY = """
    SELECT "f.slope", count(*), count(*) FILTER (passed), median(speed), min(speed), max(speed)
    FROM read_parquet(?) WHERE "f.ground" = ? AND "f.nails" = ? AND "f.law" = ?
    GROUP BY 1 ORDER BY 1
"""


def main(table):
    figure, axes = plt.subplots(1, len(GROUNDS), figsize=(12, 3.4), sharey=True, layout="constrained")
    for axis, ground in zip(axes, GROUNDS):
        for law, name in LAWS.items():
            for nails, style in NAILS.items():
                rows = duckdb.execute(QUERY, [table, ground, nails, law]).fetchall()
                slope, cases, climbed, median, low, high = zip(*rows)
                axis.plot(slope, median, style, color=COLOURS[law], label=f"{name}, {nails} mm")
                axis.fill_between(slope, low, high, color=COLOURS[law], alpha=0.12, linewidth=0)
                full = [(s, m) for s, m, n, of in zip(slope, median, climbed, cases) if n == of]
                axis.plot(*zip(*full) if full else ([], []), "o", color=COLOURS[law], markersize=3.5)
        axis.axhline(BAR_MM_S, color="0.5", linewidth=0.8)
        axis.set(title=ground.replace("-", " "), xlabel="slope, degrees", xlim=(3, 22))
        axis.grid(alpha=0.3)
    axes[0].set(ylabel="speed up the slope, mm/s")
    axes[-1].legend(fontsize=7, title="law, nails", title_fontsize=7)
    figure.suptitle("60 mm/s asked for; dots: all of 5 runs climb (above 20 mm/s, wheels grip, no tail on the ground); bands: all 5 runs", fontsize=9)
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    main(sys.argv[1])

"""Opens the table of a shipped campaign with DuckDB and asks it the plan's questions.

Usage: check_campaign.py CASES.parquet QUESTIONS.sql ROWS
"""

import json
import math
import sys
from pathlib import Path

import duckdb


def check_spread(rows, failed, robots, supplies, pairs, worst) -> None:
    assert sum(row[1] for row in robots) == rows, robots
    assert sum(row[2] for row in supplies) == rows, supplies
    assert sum(row[2] for row in pairs) == rows // 2, pairs
    assert failed == rows - sum(row[2] for row in robots), robots
    assert len(worst) == min(5, failed), worst


def check_steep(rows, failed, climbed, ends) -> None:
    assert len(climbed) == len({row[:3] for row in climbed}) > 1, climbed
    for *_, always, ever in climbed:
        assert always is None or ever >= always, climbed
    # A slope of 4 degrees of rock is climbed, one of 21 degrees of ash is not.
    assert all(row[3] is not None for row in climbed if row[0] == "rock"), climbed
    assert all(row[4] != 21 for row in climbed if row[0] == "loose-ash"), climbed
    assert sum(row[2] for row in ends) == failed > 0, ends
    for _, _, lost, *reasons in ends:
        assert sum(reasons) >= lost, ends


def check_cylinder(rows, failed, axes, thirds, pairs, worst) -> None:
    assert sum(row[2] for row in axes) == sum(row[3] for row in thirds) == rows, axes
    assert failed == rows - sum(row[3] for row in axes), axes
    assert all(row[5] is None or row[5] > 0 for row in axes), axes
    assert {row[1] for row in thirds} <= {0, 1, 2} >= {row[2] for row in thirds}, thirds
    assert sum(row[2] for row in pairs) == rows // 2, pairs
    assert len(worst) <= min(5, failed), worst


def check_first_step(rows, failed, axes, regions, worst) -> None:
    assert sum(row[2] for row in axes) == rows, axes
    assert failed == sum(row[3] for row in axes), axes
    assert sum(row[3] for row in regions) == rows // 2, regions
    for *_, cases, missed, low, high in regions:
        assert low - 1e-9 <= 100 * missed / cases <= high + 1e-9, regions
    assert len(worst) <= min(5, failed), worst


def check_leg(rows, failed, *answers) -> None:
    # Macros and views answer nothing.
    *_, legs, sets, ratios, terrains, told = answers
    crank, radius, hip, bore, paper, conditioning = range(6)
    assert len(legs) == 4 and sum(leg[paper] for leg in legs) == 1, legs
    by_leg = {(leg[radius], leg[bore]): leg for leg in legs}
    # A foot farther out is better conditioned, a smaller bore leaves that as it is and pushes less.
    assert by_leg[60, 1][conditioning] > 1.2 * by_leg[10, 1][conditioning], legs
    assert by_leg[10, 0.8][conditioning] == by_leg[10, 1][conditioning], legs
    force = [by_leg[10, bore][8] for bore in (0.8, 1)]
    assert abs(force[0] / force[1] - 0.64) < 1e-9, legs
    # The picked leg is the first of those that it may be, on either set; so is the paper's.
    met = max(leg[10] for leg in legs)
    best = min(leg[11] for leg in legs if leg[10] == met)
    picked = [row for row in sets if row[1] == "picked"]
    assert {row[:2] for row in sets} <= {
        (terrains, leg) for terrains in ("design", "held out") for leg in ("paper", "picked")
    }, sets
    assert all(row[8] <= 100 * row[7] / row[6] <= row[9] for row in sets), sets
    if picked:
        assert abs(picked[0][10] - best) < 0.006, (picked, best)
        assert all(low <= ratio <= high for _, _, ratio, low, high in ratios), ratios
        assert [row[1] for row in ratios] == [2, 2], ratios
    assert sum(row[3] for row in terrains) == sum(row[6] for row in sets), terrains
    # Where every case passed, no rank of passing tells anything.
    air, passed = told[0][::2], told[0][1::2]
    assert len(told) == 1 and all(-1 <= r <= 1 for r in air), told
    assert all(r is None or math.isnan(r) or -1 <= r <= 1 for r in passed), told


def main() -> int:
    table, sql, rows = sys.argv[1], sys.argv[2], int(sys.argv[3])
    connection = duckdb.connect()
    facts = connection.execute(
        "SELECT decode(key), decode(value) FROM parquet_kv_metadata(?)", [table]
    ).fetchall()
    facts = dict(facts)
    columns = json.loads(facts["wheeleg.columns"])
    found = connection.execute(
        "SELECT column_name FROM (DESCRIBE SELECT * FROM read_parquet(?))", [table]
    ).fetchall()
    assert [c["name"] for c in columns] == [name for (name,) in found], found
    assert all(c["meaning"] for c in columns), "a column without a meaning"
    plan = json.loads(facts["wheeleg.plan"])
    assert plan["cases"] == rows, plan["cases"]
    count, distinct = connection.execute(
        'SELECT count(*), count(DISTINCT "case") FROM read_parquet(?)', [table]
    ).fetchone()
    assert (count, distinct) == (rows, rows), (count, distinct)
    connection.execute(f"SET VARIABLE cases = '{table}'")
    with open(sql, encoding="utf-8") as file:
        statements = duckdb.extract_statements(file.read())
    answers = [connection.execute(statement).fetchall() for statement in statements]
    failed = connection.execute(
        "SELECT count(*) FROM read_parquet(?) WHERE NOT coalesce(passed, false)", [table]
    ).fetchone()[0]
    check = {
        "three-step-spread": check_spread,
        "how-steep": check_steep,
        "leg-design": check_leg,
        "cylinder-spread": check_cylinder,
        "first-step": check_first_step,
    }[Path(sql).stem]
    check(rows, failed, *answers)
    print(f"duckdb {duckdb.__version__}: {rows} rows, {len(columns)} columns, {answers[0]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

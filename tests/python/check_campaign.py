"""Opens the table of a campaign with DuckDB and asks it the questions of campaign.sql.

Usage: check_campaign.py CASES.parquet CAMPAIGN.sql ROWS
"""

import json
import sys

import duckdb


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
    robots, supplies, pairs, worst = answers
    assert sum(row[1] for row in robots) == rows, robots
    assert sum(row[2] for row in supplies) == rows, supplies
    assert sum(row[2] for row in pairs) == rows // 2, pairs
    failed = rows - sum(row[2] for row in robots)
    assert len(worst) == min(5, failed), worst
    print(f"duckdb {duckdb.__version__}: {rows} rows, {len(columns)} columns, {robots}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

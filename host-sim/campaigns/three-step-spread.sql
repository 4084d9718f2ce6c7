-- Questions to the table of `three-step-spread`, for DuckDB. Before it:
--     SET VARIABLE cases = 'cases.parquet';
-- The columns of factors are "f.NAME"; each target has a value, "ID", and a verdict, "ID.pass". `passed` is NULL in a
-- case without a result, which has not met its targets.

-- How many cases meet all required targets, by robot?
SELECT
    "f.robot" AS robot,
    count(*) AS cases,
    count(*) FILTER (passed) AS passed,
    count(*) FILTER (status <> 'ok') AS without_result
FROM read_parquet(getvariable('cases'))
GROUP BY robot
ORDER BY robot;

-- The same, by supply in tenths of the file's pressure.
SELECT
    "f.robot" AS robot,
    round("f.supply", 1) AS supply,
    count(*) AS cases,
    count(*) FILTER (passed) AS passed,
    round(median("A20"), 1) AS b6_stroke_mm
FROM read_parquet(getvariable('cases'))
GROUP BY robot, supply
ORDER BY robot, supply;

-- Pairs with the same noise: what one robot meets and the other does not.
SELECT
    coalesce(a.passed, false) AS paper,
    coalesce(b.passed, false) AS predictive,
    count(*) AS pairs
FROM read_parquet(getvariable('cases')) AS a
JOIN read_parquet(getvariable('cases')) AS b USING (sample, replicate)
WHERE a."f.robot" = 'wheeleg-2003' AND b."f.robot" = 'wheeleg'
GROUP BY ALL
ORDER BY ALL;

-- The cases to look at: `wheeleg campaign replay cases.parquet CASE` runs one again.
SELECT "case", status, error, "f.robot" AS robot, "f.supply" AS supply, "f.friction" AS friction
FROM read_parquet(getvariable('cases'))
WHERE NOT coalesce(passed, false)
ORDER BY "A20" NULLS FIRST
LIMIT 5;

-- Questions to the table of `cylinder-spread`, for DuckDB. Before it:
--     SET VARIABLE cases = 'cases.parquet';
-- The columns of factors are "f.NAME"; each target has a value, "ID", and a verdict, "ID.pass". `passed` is NULL in a
-- case without a result, which has not met its targets.

-- How many cases miss, by axis and controller, and how long does a move take?
SELECT
    "f.axis" AS axis,
    "f.controller" AS controller,
    count(*) AS cases,
    count(*) FILTER (passed) AS passed,
    count(*) FILTER ("faults" > 0) AS with_fault,
    round(median("settling"), 2) AS settling_s,
    round(median("air"), 2) AS air_dm3
FROM read_parquet(getvariable('cases'))
GROUP BY axis, controller
ORDER BY axis, controller;

-- Does the load or the delay of the valves make the difference? By thirds of each.
SELECT
    "f.controller" AS controller,
    floor(abs("f.load") / 0.2667) AS load_third,
    floor(ln("f.delay" / 0.5) / ln(4) * 2.9999) AS delay_third,
    count(*) AS cases,
    count(*) FILTER (passed) AS passed
FROM read_parquet(getvariable('cases'))
GROUP BY controller, load_third, delay_third
ORDER BY controller, load_third, delay_third;

-- Pairs with the same noise: what one controller meets and the other does not.
SELECT
    coalesce(a.passed, false) AS paper,
    coalesce(b.passed, false) AS predictive,
    count(*) AS pairs
FROM read_parquet(getvariable('cases')) AS a
JOIN read_parquet(getvariable('cases')) AS b USING ("f.axis", sample, replicate)
WHERE a."f.controller" = 'fuzzy-pd' AND b."f.controller" = 'predictive'
GROUP BY ALL
ORDER BY ALL;

-- The predictive law's cases to look at: `wheeleg campaign replay cases.parquet CASE` plays one again.
SELECT "case", error, "rest-error", "overshoot", "valve-resolution" AS resolution
FROM read_parquet(getvariable('cases'))
WHERE "f.controller" = 'predictive' AND NOT coalesce(passed, false)
ORDER BY abs("rest-error") DESC NULLS FIRST
LIMIT 5;

-- Questions to the table of `first-step`, for DuckDB. Before it:
--     SET VARIABLE cases = 'cases.parquet';
-- The columns of factors are "f.NAME"; each target has a value, "ID", and a verdict, "ID.pass". `passed` is NULL in a
-- case without a result, which has not met its targets.

-- How many cases miss, by axis and controller, and what do they miss?
SELECT
    "f.axis" AS axis,
    "f.controller" AS controller,
    count(*) AS cases,
    count(*) FILTER (NOT coalesce(passed, false)) AS missed,
    count(*) FILTER (NOT coalesce("rest-error.pass", false)) AS rest,
    count(*) FILTER (NOT coalesce("overshoot.pass", false)) AS overshoot,
    count(*) FILTER (NOT coalesce("reversals.pass", false)) AS swings,
    count(*) FILTER (NOT coalesce("faults.pass", false)) AS faults,
    count(*) FILTER (passed IS NULL) AS no_result
FROM read_parquet(getvariable('cases'))
GROUP BY axis, controller
ORDER BY axis, controller;

-- Where does the predictive law miss? By mass and load, in per cent, with Wilson's interval of 95 %.
WITH regions AS (
    SELECT
        "f.axis" AS axis,
        -- Thirds of the range of each, the mass by its logarithm.
        least(floor(3 * ln("f.mass" / 0.667) / ln(5.333 / 0.667)), 2)::INT AS mass_third,
        least(floor(3 * abs("f.load") / 0.8), 2)::INT AS load_third,
        count(*) AS n,
        count(*) FILTER (NOT coalesce(passed, false)) AS k
    FROM read_parquet(getvariable('cases'))
    WHERE "f.controller" = 'predictive'
    GROUP BY ALL
)
SELECT
    axis,
    mass_third,
    load_third,
    n AS cases,
    k AS missed,
    100 * greatest((k + 1.9208 - 1.96 * sqrt(k * (n - k) / n + 0.9604)) / (n + 3.8416), 0) AS low,
    100 * (k + 1.9208 + 1.96 * sqrt(k * (n - k) / n + 0.9604)) / (n + 3.8416) AS high
FROM regions
ORDER BY axis, mass_third, load_third;

-- Its worst cases: `wheeleg campaign replay cases.parquet CASE` plays one again.
SELECT "case", "f.axis" AS axis, error, "rest-error", "overshoot", "f.mass" AS mass, "f.load" AS load
FROM read_parquet(getvariable('cases'))
WHERE "f.controller" = 'predictive' AND NOT coalesce(passed, false)
ORDER BY greatest(abs("rest-error") / 0.5, "overshoot" / 6) DESC NULLS FIRST
LIMIT 5;

-- Questions to the table of `how-steep`, for DuckDB. Before it:
--     SET VARIABLE cases = 'cases.parquet';

-- Where does each combination cease to climb? `always`: the steepest slope up to which all replicates of
-- all slopes climbed; `ever`: the steepest that any replicate climbed.
WITH cells AS (
    SELECT
        "f.ground" AS ground, "f.nails" AS nails_mm, "f.law" AS law, "f.slope" AS slope_deg,
        count(*) AS cases,
        count(*) FILTER (passed) AS climbed
    FROM read_parquet(getvariable('cases'))
    GROUP BY ALL
),
first_failure AS (
    SELECT ground, nails_mm, law, coalesce(min(slope_deg) FILTER (climbed < cases), 1e9) AS failed_deg
    FROM cells
    GROUP BY ALL
)
SELECT
    ground, nails_mm, law,
    max(slope_deg) FILTER (slope_deg < failed_deg) AS always_deg,
    max(slope_deg) FILTER (climbed > 0) AS ever_deg
FROM cells
JOIN first_failure USING (ground, nails_mm, law)
GROUP BY ALL
ORDER BY ground, nails_mm, law;

-- What ends a climb: too slow, wheels that spin, or the tail on the ground.
SELECT
    "f.ground" AS ground, "f.law" AS law,
    count(*) FILTER (NOT coalesce(passed, false)) AS failed,
    count(*) FILTER (NOT "speed.pass") AS too_slow,
    count(*) FILTER (NOT "slip.pass") AS spinning,
    count(*) FILTER (NOT "chassis-force.pass") AS on_its_tail,
    count(*) FILTER (status <> 'ok') AS without_result
FROM read_parquet(getvariable('cases'))
GROUP BY ALL
ORDER BY ground, law;

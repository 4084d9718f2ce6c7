-- Questions to the table of `leg-design`, for DuckDB. Before it:
--     SET VARIABLE cases = 'cases.parquet';

-- 97.5 % point of Student's t at so many degrees of freedom: Abramowitz and Stegun 26.7.5; at 3
-- of them 0.1 % off.
CREATE OR REPLACE TEMP MACRO student(nu) AS
    1.95996 + 2.37227 / nu + 2.82250 / nu ** 2 + 2.55585 / nu ** 3 + 1.58953 / nu ** 4;
-- Wilson's interval of a share of `n` cases, 95 %: below and above.
CREATE OR REPLACE TEMP MACRO wilson(met, n, side) AS
    (met + 1.92073 + side * 1.95996 * sqrt(met * (n - met) / n + 0.96036)) / (n + 3.84146);
-- Rank in a column, the mean of those that equal values share.
CREATE OR REPLACE TEMP MACRO mean_rank(x) AS
    rank() OVER (ORDER BY x) + (count(*) OVER (PARTITION BY x) - 1) / 2;

CREATE OR REPLACE TEMP VIEW walks AS
SELECT
    "f.crank" AS crank, "f.radius" AS radius_mm, "f.hip" AS hip_mm, "f.bore" AS bore,
    "f.terrain" AS terrain,
    "f.terrain" IN ('walk', 'turn', 'sand-slope-10', 'rock-slope') AS design,
    sample AS machine,
    coalesce(passed, false) AS passed,
    "air-per-metre" AS air, "air-per-step" AS air_per_step, "step-time" AS step_s, speed,
    conditioning, manipulability, workspace, "foot-force" AS foot_force
FROM read_parquet(getvariable('cases'));

-- Each leg: its indices, and what it does on the design terrains.
CREATE OR REPLACE TEMP VIEW legs AS
SELECT
    crank, radius_mm, hip_mm, bore,
    crank = 1 AND radius_mm = 10 AND hip_mm = 600 AND bore = 1 AS paper,
    max(conditioning) AS conditioning, max(manipulability) AS manipulability,
    max(workspace) AS workspace_dm3, max(foot_force) AS foot_force_n,
    count(*) AS cases, count(*) FILTER (passed) AS met,
    avg(air) AS air_dm3_m, avg(air_per_step) AS air_dm3, avg(step_s) AS step_s
FROM walks
WHERE design
GROUP BY ALL;

-- The criterion. Of the legs that are not worse than the paper's in conditioning and workspace and
-- pass as many design cases as the best of them: the least air for a metre.
CREATE OR REPLACE TEMP VIEW picked AS
WITH candidates AS (
    SELECT legs.*
    FROM legs
    JOIN legs AS paper ON paper.paper
    WHERE legs.conditioning >= paper.conditioning AND legs.workspace_dm3 >= paper.workspace_dm3
)
SELECT * FROM candidates
WHERE met = (SELECT max(met) FROM candidates)
ORDER BY air_dm3_m, crank, radius_mm, hip_mm, bore
LIMIT 1;

-- 1. All legs on the design terrains, the most passes and the least air first.
SELECT * FROM legs ORDER BY met DESC, air_dm3_m;

-- 2. The picked leg and the paper's, on either set: passes with their interval, and means.
SELECT
    CASE WHEN design THEN 'design' ELSE 'held out' END AS terrains,
    CASE WHEN legs.paper THEN 'paper' ELSE 'picked' END AS leg,
    crank, radius_mm, hip_mm, bore,
    count(*) AS cases,
    count(*) FILTER (passed) AS met,
    round(100 * wilson(count(*) FILTER (passed), count(*), -1), 1) AS met_from_percent,
    round(100 * wilson(count(*) FILTER (passed), count(*), 1), 1) AS met_to_percent,
    round(avg(air), 2) AS air_dm3_m,
    round(avg(walks.air_per_step), 2) AS air_dm3,
    round(avg(walks.step_s), 2) AS step_s,
    round(avg(speed), 1) AS speed_mm_s
FROM walks
JOIN legs USING (crank, radius_mm, hip_mm, bore)
WHERE legs.paper OR (crank, radius_mm, hip_mm, bore) IN (SELECT (crank, radius_mm, hip_mm, bore) FROM picked)
GROUP BY ALL
ORDER BY terrains, leg;

-- 3. Air for a metre, picked over paper, on the same machines: a terrain counts once, so that the
-- interval (geometric mean, 95 %) is one for other terrains like these.
WITH pairs AS (
    SELECT a.design, a.terrain, avg(ln(a.air / b.air)) AS log_ratio
    FROM walks AS a
    JOIN picked USING (crank, radius_mm, hip_mm, bore)
    JOIN walks AS b ON a.terrain = b.terrain AND a.machine = b.machine
    JOIN legs ON legs.paper AND (b.crank, b.radius_mm, b.hip_mm, b.bore)
        = (legs.crank, legs.radius_mm, legs.hip_mm, legs.bore)
    WHERE a.air IS NOT NULL AND b.air IS NOT NULL
    GROUP BY ALL
)
SELECT
    CASE WHEN design THEN 'design' ELSE 'held out' END AS terrains,
    count(*) AS n,
    round(exp(avg(log_ratio)), 3) AS air_ratio,
    round(exp(avg(log_ratio) - student(count(*) - 1) * stddev_samp(log_ratio) / sqrt(count(*))), 3) AS from_ratio,
    round(exp(avg(log_ratio) + student(count(*) - 1) * stddev_samp(log_ratio) / sqrt(count(*))), 3) AS to_ratio
FROM pairs
GROUP BY ALL
ORDER BY terrains;

-- 4. The same, terrain by terrain.
SELECT
    terrain, design,
    CASE WHEN legs.paper THEN 'paper' ELSE 'picked' END AS leg,
    count(*) AS cases, count(*) FILTER (passed) AS met,
    round(avg(air), 2) AS air_dm3_m, round(avg(speed), 1) AS speed_mm_s
FROM walks
JOIN legs USING (crank, radius_mm, hip_mm, bore)
WHERE legs.paper OR (crank, radius_mm, hip_mm, bore) IN (SELECT (crank, radius_mm, hip_mm, bore) FROM picked)
GROUP BY ALL
ORDER BY design DESC, terrain, leg;

-- 5. What an index tells of a walk: its rank correlation, over the legs, with air and with passes on
-- the design terrains.
WITH ranked AS (
    SELECT
        mean_rank(conditioning) AS conditioning, mean_rank(workspace_dm3) AS workspace,
        mean_rank(foot_force_n) AS foot_force, mean_rank(air_dm3_m) AS air, mean_rank(met) AS met
    FROM legs
)
SELECT
    round(corr(conditioning, air), 2) AS conditioning_air, round(corr(conditioning, met), 2) AS conditioning_met,
    round(corr(workspace, air), 2) AS workspace_air, round(corr(workspace, met), 2) AS workspace_met,
    round(corr(foot_force, air), 2) AS force_air, round(corr(foot_force, met), 2) AS force_met
FROM ranked;

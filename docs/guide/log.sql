-- Questions to a log, in DuckDB:  SET VARIABLE folder = 'runs/walk-seed1/parquet';
-- Channels have rates of their own: ASOF JOIN takes the newest row of the other channel.

-- What each cylinder of the left leg did when the left foot touched the ground or left it.
SELECT e.t_ns * 1e-9 AS t_s, e.code, round(v.position_mm, 1) AS vertical_mm,
       round(v.force_net_n, 1) AS vertical_n, round(h.position_mm, 1) AS horizontal_mm
FROM read_parquet(getvariable('folder') || '/events.parquet') AS e
ASOF JOIN read_parquet(getvariable('folder') || '/joint-3.parquet') AS v ON e.t_ns >= v.t_ns
ASOF JOIN read_parquet(getvariable('folder') || '/joint-2.parquet') AS h ON e.t_ns >= h.t_ns
WHERE e.kind = 'contact' AND e.detail = 'left'
ORDER BY e.t_ns;

-- Air and way of each step of the gait.
SELECT m.step, round(max(b.x_mm) - min(b.x_mm), 1) AS way_mm,
       round(max(s.air_used_dm3) - min(s.air_used_dm3), 2) AS air_dm3
FROM read_parquet(getvariable('folder') || '/master.parquet') AS m
ASOF JOIN read_parquet(getvariable('folder') || '/body.parquet') AS b ON m.t_ns >= b.t_ns
ASOF JOIN read_parquet(getvariable('folder') || '/supply.parquet') AS s ON m.t_ns >= s.t_ns
GROUP BY m.step
ORDER BY m.step;

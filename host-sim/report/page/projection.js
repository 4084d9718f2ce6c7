// From millimetres in the world to a drawing.

export const tenth = (v) => Math.round(v * 10) / 10;
/** Oblique projection: depth goes right and up, x and z stay true. */
export const oblique = (x, y, z) => [tenth(x + 0.26 * y), tenth(-(z + 0.2 * y))];
export const points = (list) => list.map((p) => p.join(",")).join(" ");

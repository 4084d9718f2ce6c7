// Sampled signals: values at instants, read at any time between them.

/** Index of the last instant at or before `t`, at least 0. @param {ArrayLike<number>} times @param {number} t */
export function before(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Value at `t`, on a straight line between two samples; null before the first, after the last and in a gap.
 * @param {ArrayLike<number>} times @param {ArrayLike<number | null>} values @param {number} t @returns {number | null} */
export function linear(times, values, t) {
  const last = times.length - 1;
  if (last < 0 || t < times[0] || t > times[last]) return null;
  const i = before(times, t);
  if (i === last) return values[last];
  const [here, next] = [values[i], values[i + 1]];
  if (here == null || next == null) return null;
  const width = times[i + 1] - times[i];
  const part = width > 0 ? (t - times[i]) / width : 1;
  return here + part * (next - here);
}

/** Value of the last sample at or before `t`. @param {ArrayLike<number>} times @param {ArrayLike<number>} values @param {number} t */
export function held(times, values, t) {
  return values[before(times, t)];
}

//! Motion by the method of Runge and Kutta.

use nalgebra::SVector;

/// Moves position `q` and speed `v` on by `h` seconds; `rate` gives the acceleration.
pub(crate) fn step<const N: usize>(
    q: &mut SVector<f64, N>,
    v: &mut SVector<f64, N>,
    h: f64,
    rate: impl Fn(&SVector<f64, N>, &SVector<f64, N>) -> SVector<f64, N>,
) {
    let (v1, a1) = (*v, rate(q, v));
    let (v2, a2) = (
        *v + a1 * (h / 2.0),
        rate(&(*q + v1 * (h / 2.0)), &(*v + a1 * (h / 2.0))),
    );
    let (v3, a3) = (
        *v + a2 * (h / 2.0),
        rate(&(*q + v2 * (h / 2.0)), &(*v + a2 * (h / 2.0))),
    );
    let (v4, a4) = (*v + a3 * h, rate(&(*q + v3 * h), &(*v + a3 * h)));
    *q += (v1 + (v2 + v3) * 2.0 + v4) * (h / 6.0);
    *v += (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0);
}

use super::*;
use wheeleg_kinematics::Phi;

fn model() -> Model {
    Model::new().expect("the paper's leg")
}

fn evaluate(number: &str, s: &State<'_>) -> Vec<Component> {
    let equation = r2p::EQUATIONS
        .iter()
        .chain(&rpr::EQUATIONS)
        .find(|e| e.number == number)
        .expect("listed");
    (equation.evaluate)(s)
}

fn component(number: &str, label: &str, s: &State<'_>) -> (f64, f64) {
    let found = evaluate(number, s).into_iter().find(|c| c.label == label);
    let found = found.expect("listed");
    (found.printed, found.corrected)
}

fn near(got: (f64, f64), expected: (f64, f64), within: f64) {
    assert!(
        (got.0 - expected.0).abs() < within,
        "printed {got:?} {expected:?}"
    );
    assert!(
        (got.1 - expected.1).abs() < within,
        "corrected {got:?} {expected:?}"
    );
}

/// MODEL.md §10, (16): a leg at θ4 = 90° with θ̇4 = 1, θ̈4 = 2, b5 = .19, ḃ5 = .2, b̈5 = .5.
#[test]
fn equation_16_has_the_numbers_of_the_audit() {
    let model = model();
    let still = [Vector3::zeros(); 2];
    let home = model.state([0.40, 0.19, 0.1], still).expect("reachable");
    let (first, second) = (home.leg.phi_prime, home.leg.phi_second);
    let b2_dot = 1.0 / first;
    let b2_ddot = (2.0 - second * b2_dot * b2_dot) / first;
    let motion = [
        Vector3::new(b2_dot, 0.2, 0.0),
        Vector3::new(b2_ddot, 0.5, 0.0),
    ];
    let s = model.state([0.40, 0.19, 0.1], motion).expect("reachable");
    near(component("16", "ṗx", &s), (0.50, 0.31), 1e-12);
    near(component("16", "ṗy", &s), (0.40, 0.78), 1e-12);
    // (13) lacks b5 θ̇4 sideways and has the wrong sign of the turn.
    near(component("13", "ṗy", &s), (0.0, 0.19), 1e-12);
    near(component("13", "ωz", &s), (-1.0, 1.0), 1e-12);
}

/// MODEL.md §12: the golden state's force with the printed (58) and (64).
#[test]
fn forces_have_the_golden_numbers() {
    let model = model();
    let motion = [Vector3::new(0.1, -0.2, 0.3), Vector3::new(1.0, -2.0, 3.0)];
    let s = model.state([0.43, 0.12, 0.15], motion).expect("reachable");
    let got = component("58, 64 in (54)", "τ of b2", &s);
    near(got, (0.572777909820, 0.529374578203), 1e-11);
}

/// MODEL.md §3: (34) at φ = −20° and +20° with k3 = π/4.
#[test]
fn equation_34_has_the_numbers_of_the_audit() {
    let model = model();
    for (degrees, printed, corrected) in [(-20.0_f64, 0.357, 0.179), (20.0, -0.155, -0.381)] {
        let closure = model
            .geometry
            .closure_from_phi(Phi::new(degrees.to_radians()));
        let b2 = closure.expect("closes").b2_m;
        let motion = [Vector3::new(-0.1, 0.0, 0.0), Vector3::zeros()];
        let s = model.state([b2, 0.1, 0.1], motion).expect("reachable");
        let got = component("34", "θ̇1", &s);
        near(
            (got.0 / s.xd[3], got.1 / s.xd[3]),
            (printed, corrected),
            6e-4,
        );
    }
}

/// MODEL.md §3: the printed quartic's root has the wrong sign, and is a root of it.
#[test]
fn equation_27_has_the_numbers_of_the_audit() {
    let model = model();
    let still = [Vector3::zeros(); 2];
    let s = model.state([0.45037, 0.1, 0.1], still).expect("reachable");
    assert!(
        (s.x[2].to_degrees() + 9.44).abs() < 0.01,
        "{}",
        s.x[2].to_degrees()
    );
    let (printed, corrected) = component("27", "θ1", &s);
    let degrees = |rad: f64| rad.to_degrees() - 180.0;
    near((degrees(printed), degrees(corrected)), (0.57, -0.56), 6e-3);
    let gamma = (printed / 2.0).tan();
    let theta3 = wheeleg_kinematics::Theta3::new(s.x[2]);
    let value = wheeleg_kinematics::printed::quartic_27(0.29, [0.29, 0.40], theta3, gamma);
    assert!(value.abs() < 1e-9 * gamma.powi(4), "{value} at {gamma}");
}

fn table() -> Vec<Misprint> {
    misprints(&mut |_| ()).expect("inside the strokes")
}

#[test]
fn every_misprint_of_the_audit_is_shown_to_be_one() {
    let table = table();
    let wrong = [
        "5", "11", "13", "15", "27", "31", "32", "34", "36", "38", "39", "58", "64",
    ];
    let home = ["9", "14", "16", "21", "28", "35", "37", "55", "61"];
    for number in wrong {
        let lines = table.iter().filter(|m| m.equation == number);
        let worst = lines.clone().filter(|m| m.status == Status::Wrong);
        let worst = worst.filter_map(|m| m.worst).fold(0.0, f64::max);
        assert!(worst > 1e-3, "({number}): {worst}");
    }
    for number in home {
        for m in table.iter().filter(|m| m.equation == number) {
            assert_eq!(m.status, Status::Home);
            // (16) lacks b5 θ̈4, so it is right only for b5 → 0; home has b5 = 0.01 m, ℓ = 0.29 m.
            let allowed = if number == "16" {
                1.05 * 0.01 * ACCELERATION_M_S2 / 0.29
            } else {
                1e-12
            };
            assert!(m.at_home.is_some_and(|d| d < allowed), "{m:?}");
        }
        let lines = table.iter().filter(|m| m.equation == number);
        let worst = lines.filter_map(|m| m.worst).fold(0.0, f64::max);
        assert!(worst > 1e-2, "({number}): {worst}");
    }
    // Values that are not finite are counted, never averaged away: (7) at yp = 0, (25) and (33) at home.
    for number in ["7", "25", "33"] {
        let m = table
            .iter()
            .rfind(|m| m.equation == number)
            .expect("listed");
        assert!(m.worst.is_none_or(|w| w > 0.01), "{m:?}");
    }
}

/// MODEL.md §10: the velocities and accelerations of the figures' cylinders, and all forces, are
/// the same in both forms, because the leg does not yaw in any figure.
#[test]
fn no_figure_of_the_paper_can_tell() {
    let table = table();
    for number in ["13", "16", "39", "58, 64 in (54)", "15", "34"] {
        for m in table.iter().filter(|m| m.equation == number) {
            assert!(m.in_figures.is_some_and(|d| d < 1e-12), "{m:?}");
        }
    }
    // ... while (5), (11) and (18) would show.
    for number in ["5", "11", "18"] {
        let lines = table.iter().filter(|m| m.equation == number);
        let worst = lines.filter_map(|m| m.in_figures).fold(0.0, f64::max);
        assert!(worst > 1e-3, "({number}): {worst}");
    }
}

//! The whole robot on soil.

use nalgebra::Vector3;
use wheeleg_plant::body::Toucher;
use wheeleg_plant::soil::Soil;
use wheeleg_plant::soil::wheel::Wheel;
use wheeleg_plant::terrain::{Material, Part, Plane, Shape};
use wheeleg_plant::testing::{wheeleg_2003, wheeleg_field};
use wheeleg_plant::{Inputs, Plant, PlantParams, PlantState};

/// A robot with its legs at mid stroke on a slope of soil.
fn on(soil: Soil, degrees: f64, mut params: PlantParams) -> (Plant, PlantState) {
    params.initial_stroke_m = [0.09, 0.09, 0.18, 0.09, 0.09, 0.18];
    params.terrain.parts = vec![Part {
        shape: Shape::Plane(Plane::sloping(degrees.to_radians(), 0.0)),
        material: Material::soft(soil),
    }];
    let plant = Plant::new(&params).unwrap();
    let state = plant.initial_state(1).unwrap();
    (plant, state)
}

fn wheel(params: &PlantParams) -> Wheel {
    Wheel {
        radius_m: params.body.wheel_radius_m,
        width_m: params.contacts.wheel.width_m,
        lug_m: params.contacts.wheel.lug_m,
    }
}

#[test]
fn the_start_is_an_equilibrium_and_sinkages_are_those_of_the_loads() {
    for (name, _) in Soil::NAMED {
        for params in [wheeleg_2003(), wheeleg_field()] {
            for degrees in [0.0, 10.0] {
                let soil = Soil::named(name).unwrap();
                let (plant, state) = on(soil, degrees, params.clone());
                let scene = plant.assembly.mechanics.scene(&state.core.motion).unwrap();
                let weight = params.body.total_mass_kg() * 9.81;
                let contacts = &scene.loads.contacts;
                let total: Vector3<f64> = contacts.all().iter().map(|w| w.force_n).sum();
                let error = (total - weight * Vector3::z()).norm();
                let loads = &scene.loads;
                println!("{name} {degrees}: {loads:?} off by {error}");
                assert!(error < 1e-6 * weight, "{name} {degrees}: {error}");
                for (side, load) in scene.loads.wheels.iter().enumerate() {
                    let own = wheel(&params);
                    let alone = own.forces(&soil, load.sinkage_m, 0.0).normal_n;
                    if degrees == 0.0 {
                        let pull = contacts.wheels[side].force_n.x;
                        assert!(pull.abs() < 1e-6, "{name}: {pull}");
                        assert!((load.normal_n / alone - 1.0).abs() < 0.002, "{name}");
                    }
                }
            }
        }
    }
}

#[test]
fn at_rest_it_neither_moves_nor_chatters() {
    let (plant, mut state) = on(Soil::VOLCANIC_SAND, 0.0, wheeleg_field());
    let start = plant.outputs(&state);
    let (mut fastest, mut turns) = (0.0_f64, 0);
    let mut last = 0.0;
    for k in 0..3000 {
        plant.tick(&mut state, &Inputs::default()).unwrap();
        let o = plant.outputs(&state);
        if k > 1000 {
            fastest = fastest.max(Vector3::from(o.velocity_m_s).norm());
            let force = plant.assembly.mechanics.scene(&state.core.motion).unwrap();
            let pull = force.loads.contacts.wheels[0].force_n.x;
            turns += usize::from(pull * last < 0.0 && pull.abs() > 0.01);
            last = pull;
        }
    }
    let end = plant.outputs(&state);
    let gone = (Vector3::from(end.position_m) - Vector3::from(start.position_m)).norm();
    println!("{gone} m, {fastest} m/s, {turns} turns, {last} N");
    assert!(gone < 5e-4 && fastest < 1e-3 && turns < 5 && last.abs() < 0.5);
    assert!(end.foot_switches.iter().flatten().all(|s| *s));
}

/// Driven by the wheels for ten seconds: travel, slip, pull on each wheel.
fn driven(soil: Soil, params: &PlantParams, step_ns: u64) -> [f64; 4] {
    let mut params = params.clone();
    params.step_ns = step_ns;
    let (plant, mut state) = on(soil, 0.0, params);
    let inputs = Inputs {
        bridge_duty: [0.4; 2],
        bridge_enabled: [true; 2],
        ..Inputs::default()
    };
    for _ in 0..6000 {
        plant.tick(&mut state, &inputs).unwrap();
    }
    let o = plant.outputs(&state);
    let scene = plant.assembly.mechanics.scene(&state.core.motion).unwrap();
    let pull = scene.loads.contacts.wheels[0].force_n.x;
    let tread = wheel(plant.params()).shear_radius_m() * o.wheel_rate_rad_s[0];
    [
        o.position_m[0],
        o.wheel_slip_m_s[0] / tread,
        pull,
        scene.loads.wheels[0].sinkage_m,
    ]
}

#[test]
fn it_drives_with_the_slip_of_its_pull_and_half_the_step_says_the_same() {
    // Plain soles drag; nails would hold.
    let mut params = wheeleg_field();
    params.contacts.foot = wheeleg_2003().contacts.foot;
    let [coarse, fine] = [100_000, 50_000].map(|h| driven(Soil::VOLCANIC_SAND, &params, h));
    println!("{coarse:?} {fine:?}");
    let [x, slip, pull, sinkage] = coarse;
    assert!(x > 0.3 && slip > 0.02 && slip < 0.5, "{x} {slip}");
    let exact = wheel(&params).forces(&Soil::VOLCANIC_SAND, sinkage, slip);
    assert!((pull - exact.drawbar_n()).abs() < 1.0, "{pull} {exact:?}");
    for (a, b) in coarse.iter().zip(fine) {
        assert!((a / b - 1.0).abs() < 0.01, "{coarse:?} {fine:?}");
    }
}

/// The front side of each sole bears 1.34 N at rest, the others more than 2.5 N.
#[test]
fn a_switch_closes_at_its_force_and_opens_at_half_of_it() {
    let front = |force_n: f64, closed: bool| {
        let mut params = wheeleg_field();
        params.contacts.foot.switch_force_n = force_n;
        let (plant, mut state) = on(Soil::VOLCANIC_SAND, 0.0, params);
        state.core.motion.contacts.switches = [[closed; 4]; 2];
        plant.tick(&mut state, &Inputs::default()).unwrap();
        let switches = plant.outputs(&state).foot_switches[0];
        assert!(switches[1..].iter().all(|s| *s), "{switches:?}");
        switches[0]
    };
    assert!(front(1.3, false));
    assert!(!front(1.4, false));
    assert!(front(1.4, true));
    assert!(!front(2.5, false) && front(2.5, true));
}

/// A sole that is lifted leaves its print; nails hold it down on the way.
#[test]
fn soil_carries_no_state_of_a_foot_in_the_air() {
    let (plant, mut state) = on(Soil::VOLCANIC_SAND, 0.0, wheeleg_field());
    let hash = plant.state_hash(&state);
    let inputs = Inputs {
        // Up: chamber A of the left vertical cylinder vented, B filled.
        valve_on_us: [[0; 4], [0; 4], [0, 1000, 1000, 0], [0; 4], [0; 4], [0; 4]],
        ..Inputs::default()
    };
    let mut least = 0.0_f64;
    for _ in 0..1500 {
        plant.tick(&mut state, &inputs).unwrap();
        least = least.min(plant.outputs(&state).foot_normal_n[0]);
    }
    let o = plant.outputs(&state);
    println!("{least} N, {} m", o.foot_clearance_m[0]);
    assert!(o.foot_clearance_m[0] > 0.06, "{:?}", o.foot_clearance_m);
    // Six nails at 60 mm: 6.8 N in, half of it out.
    assert!(least < -1.0 && least > -4.0, "{least}");
    assert!(o.foot_normal_n[0] == 0.0 && !o.foot_switches[0].contains(&true));
    let contacts = &state.core.motion.contacts;
    assert!(contacts.steps[0].iter().flatten().all(|s| s.part == 0));
    assert_ne!(plant.state_hash(&state), hash);
}

/// The contacts one by one are the same ground as their sums, hard or soft, at rest and driving.
#[test]
fn single_contacts_add_up_to_the_loads() {
    let floor = Material::ROUGH;
    for material in [Material::soft(Soil::VOLCANIC_SAND), floor] {
        let (mut plant, mut state) = on(Soil::VOLCANIC_SAND, 5.0, wheeleg_field());
        if material == floor {
            let mut params = plant.params().clone();
            params.terrain.parts[0].material = floor;
            plant = Plant::new(&params).unwrap();
            state = plant.initial_state(1).unwrap();
        }
        let inputs = Inputs {
            bridge_duty: [0.3; 2],
            bridge_enabled: [true; 2],
            ..Inputs::default()
        };
        for tick in 0..400 {
            plant.tick(&mut state, &inputs).unwrap();
            if tick % 40 > 0 {
                continue;
            }
            let mechanics = &plant.assembly.mechanics;
            let motion = &state.core.motion;
            let points = mechanics.contact_points(motion).unwrap();
            let loads = mechanics.scene(motion).unwrap().loads;
            let sum = |touches: &dyn Fn(&Toucher) -> bool| -> Vector3<f64> {
                let those = points.iter().filter(|p| touches(&p.toucher));
                those.map(|p| p.force_n).sum()
            };
            for side in 0..2 {
                let foot = sum(&|t| matches!(t, Toucher::Foot(s, _) if *s == side));
                assert!((foot - loads.feet[side].force_n).norm() < 1e-9);
                let wheel = sum(&|t| matches!(t, Toucher::Wheel(s, _) if *s == side));
                assert!((wheel - loads.contacts.wheels[side].force_n).norm() < 1e-9);
                assert!(wheel.norm() > 20.0, "{wheel}");
            }
            assert!(points.len() >= 4 && points.iter().all(|p| p.part == 0));
            for p in &points {
                let steep = p.normal.angle(&Vector3::z()).to_degrees();
                assert!((steep - 5.0).abs() < 1e-6, "{steep}");
                // Where things touch is in the ground; nails hold a sole that is over it, too.
                let above = p.point_m.dot(&p.normal);
                assert!(p.depth_m >= 0.0 && above.abs() < 0.06, "{p:?}");
                assert!(p.soft || above < 1e-9, "{p:?}");
                let normal_n = p.force_n.dot(&p.normal);
                let along = (p.force_n - normal_n * p.normal).norm();
                assert!(p.soft || along <= 0.8 * normal_n + 1e-9, "{p:?}");
                assert_eq!(p.soft, material != floor);
            }
        }
    }
}

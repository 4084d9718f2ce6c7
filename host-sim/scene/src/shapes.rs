//! The robot's shapes, each on the frame of its link.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::geometry::{MATERIALS, Shape, Solid, Tree};
use super::json::{Colour, Entity, ONCE, put};

/// Appends an entity for each link that has a shape, each with a comma before it.
pub(super) fn write(out: &mut Vec<u8>, t_ns: u64, tree: &Tree) {
    for link in tree.links.iter().filter(|link| !link.shapes.is_empty()) {
        let mut entity = Entity::new(ONCE);
        for shape in &link.shapes {
            let (at, colour) = (pose(shape), colour(shape.material));
            match shape.solid {
                Solid::Box(size) => entity.cube(&at, &size.into(), colour),
                Solid::Cylinder { radius, length } => {
                    let across = 2.0 * radius;
                    entity.cylinder(&at, &Vector3::new(across, across, length), colour);
                }
            }
        }
        put(out, ",");
        entity.write(out, t_ns, &link.name, &format!("robot/{}", link.name));
    }
}

fn pose(shape: &Shape) -> Isometry3<f64> {
    let ([x, y, z], [roll, pitch, yaw]) = (shape.xyz, shape.rpy);
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

fn colour(material: &str) -> Colour {
    let found = MATERIALS.iter().find(|(name, _)| *name == material);
    let numbers = found.map_or("", |(_, rgba)| rgba).split(' ');
    let mut colour = [0.5, 0.5, 0.5, 1.0];
    for (place, number) in colour.iter_mut().zip(numbers) {
        *place = number.parse().unwrap_or(*place);
    }
    colour
}

//! URDF: the open tree of the robot.
//!
//! URDF cannot hold a loop: a user who needs it closes `<side>_crank_end` on
//! `<side>_yaw_carriage` (all six directions; three of them are kept by the joints anyway).
//! Driven joints carry the topics of the log, `/joint/1` to `/joint/6` and `/wheel/7`, `/wheel/8`;
//! the others `<side>_theta1`, `<side>_theta3`, `<side>_theta4`. Numbers are the shortest decimals
//! that read back as the same double. Rotor inertia has no place in URDF; it is left out.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

use super::geometry::{Joint, Link, MATERIALS, Motion, Shape, Solid, Tree};
use super::tree;
use crate::SceneError;
use wheeleg_config::RobotConfig;

type Xml = Writer<Vec<u8>>;

/// The robot as URDF text.
///
/// # Errors
/// [`SceneError::Leg`] if the robot's loop does not close over its stroke.
pub fn write(robot: &RobotConfig) -> Result<String, SceneError> {
    let tree = tree::build(robot)?;
    let bytes = document(robot, &tree).map_err(|e| SceneError::Xml(e.to_string()))?;
    let mut text = String::from_utf8(bytes).map_err(|e| SceneError::Xml(e.to_string()))?;
    text.push('\n');
    Ok(text)
}

fn document(robot: &RobotConfig, tree: &Tree) -> io::Result<Vec<u8>> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let note = " Open tree, SI units. In the robot left_crank_end coincides with \
                left_yaw_carriage, and so on the right. Cylinder positions are strokes. ";
    xml.write_event(Event::Comment(BytesText::from_escaped(note)))?;
    xml.create_element("robot")
        .with_attribute(("name", robot.name.as_str()))
        .write_inner_content(|xml| {
            for (name, rgba) in MATERIALS {
                xml.create_element("material")
                    .with_attribute(("name", name))
                    .write_inner_content(|xml| empty(xml, "color", &[("rgba", rgba)]))?;
            }
            for link in &tree.links {
                write_link(xml, link)?;
            }
            for joint in &tree.joints {
                write_joint(xml, joint)?;
            }
            Ok(())
        })?;
    Ok(xml.into_inner())
}

fn empty(xml: &mut Xml, name: &str, attributes: &[(&str, &str)]) -> io::Result<()> {
    xml.create_element(name)
        .with_attributes(attributes.iter().copied())
        .write_empty()?;
    Ok(())
}

fn triple(v: [f64; 3]) -> String {
    // -0 reads as a mistake.
    v.map(|x| (x + 0.0).to_string()).join(" ")
}

fn origin(xml: &mut Xml, xyz: [f64; 3], rpy: [f64; 3]) -> io::Result<()> {
    empty(
        xml,
        "origin",
        &[("xyz", &triple(xyz)), ("rpy", &triple(rpy))],
    )
}

fn write_link(xml: &mut Xml, link: &Link) -> io::Result<()> {
    let element = xml
        .create_element("link")
        .with_attribute(("name", link.name.as_str()));
    if link.inertial.is_none() && link.shapes.is_empty() {
        element.write_empty()?;
        return Ok(());
    }
    element.write_inner_content(|xml| {
        if let Some((mass, com, [ixx, iyy, izz])) = link.inertial {
            xml.create_element("inertial").write_inner_content(|xml| {
                origin(xml, com, [0.0; 3])?;
                empty(xml, "mass", &[("value", &mass.to_string())])?;
                empty(
                    xml,
                    "inertia",
                    &[
                        ("ixx", &ixx.to_string()),
                        ("ixy", "0"),
                        ("ixz", "0"),
                        ("iyy", &iyy.to_string()),
                        ("iyz", "0"),
                        ("izz", &izz.to_string()),
                    ],
                )
            })?;
        }
        for shape in &link.shapes {
            write_shape(xml, "visual", shape)?;
            if shape.collides {
                write_shape(xml, "collision", shape)?;
            }
        }
        Ok(())
    })?;
    Ok(())
}

fn write_shape(xml: &mut Xml, kind: &str, shape: &Shape) -> io::Result<()> {
    xml.create_element(kind).write_inner_content(|xml| {
        origin(xml, shape.xyz, shape.rpy)?;
        xml.create_element("geometry")
            .write_inner_content(|xml| match shape.solid {
                Solid::Box(size) => empty(xml, "box", &[("size", &triple(size))]),
                Solid::Cylinder { radius, length } => empty(
                    xml,
                    "cylinder",
                    &[
                        ("radius", &radius.to_string()),
                        ("length", &length.to_string()),
                    ],
                ),
            })?;
        if kind == "visual" {
            empty(xml, "material", &[("name", shape.material)])?;
        }
        Ok(())
    })?;
    Ok(())
}

fn write_joint(xml: &mut Xml, joint: &Joint) -> io::Result<()> {
    let kind = match joint.motion {
        Motion::Fixed => "fixed",
        Motion::Continuous { .. } => "continuous",
        Motion::Revolute { .. } => "revolute",
        Motion::Prismatic { .. } => "prismatic",
    };
    xml.create_element("joint")
        .with_attributes([("name", joint.name.as_str()), ("type", kind)])
        .write_inner_content(|xml| {
            origin(xml, joint.xyz, [0.0, 0.0, joint.yaw])?;
            empty(xml, "parent", &[("link", &joint.parent)])?;
            empty(xml, "child", &[("link", &joint.child)])?;
            if joint.motion == Motion::Fixed {
                return Ok(());
            }
            empty(xml, "axis", &[("xyz", &triple(joint.axis))])?;
            match joint.motion {
                Motion::Fixed => Ok(()),
                Motion::Continuous {
                    effort,
                    velocity,
                    damping,
                } => {
                    limit(xml, None, effort, velocity)?;
                    empty(xml, "dynamics", &[("damping", &damping.to_string())])
                }
                Motion::Revolute {
                    lower,
                    upper,
                    velocity,
                } => limit(xml, Some((lower, upper)), 0.0, velocity),
                Motion::Prismatic {
                    stroke,
                    effort,
                    velocity,
                    damping,
                    friction,
                } => {
                    limit(xml, Some((0.0, stroke)), effort, velocity)?;
                    let (d, f) = (damping.to_string(), friction.to_string());
                    empty(xml, "dynamics", &[("damping", &d), ("friction", &f)])
                }
            }
        })?;
    Ok(())
}

fn limit(xml: &mut Xml, range: Option<(f64, f64)>, effort: f64, velocity: f64) -> io::Result<()> {
    let (effort, velocity) = (effort.to_string(), velocity.to_string());
    let ends = range.map(|(lower, upper)| [lower.to_string(), upper.to_string()]);
    let mut attributes = Vec::new();
    if let Some([lower, upper]) = &ends {
        attributes.extend([("lower", lower.as_str()), ("upper", upper.as_str())]);
    }
    attributes.extend([("effort", effort.as_str()), ("velocity", velocity.as_str())]);
    empty(xml, "limit", &attributes)
}

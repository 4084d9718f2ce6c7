//! JSON in the form of Foxglove's schemas.

use nalgebra::{Isometry3, Quaternion, Vector3};
use wheeleg_telemetry::push_fixed;

/// Digits after the point of lengths in a picture that is drawn once, m.
pub(super) const ONCE: u8 = 4;
/// The same for an entity that is drawn over and over.
pub(super) const OFTEN: u8 = 3;

/// Red, green, blue, opacity.
pub(super) type Colour = [f64; 4];

pub(super) fn put(out: &mut Vec<u8>, text: &str) {
    out.extend_from_slice(text.as_bytes());
}

/// `"key":{"x":…,"y":…,"z":…}`.
pub(super) fn put_vector(out: &mut Vec<u8>, key: &str, v: &Vector3<f64>, decimals: u8) {
    put(out, "\"");
    put(out, key);
    put(out, "\":");
    put_point(out, v, decimals);
}

fn put_point(out: &mut Vec<u8>, v: &Vector3<f64>, decimals: u8) {
    for (name, value) in ["{\"x\":", ",\"y\":", ",\"z\":"].into_iter().zip(v.iter()) {
        put(out, name);
        push_fixed(out, *value, decimals);
    }
    put(out, "}");
}

/// `"key":{"x":…,"y":…,"z":…,"w":…}`, with the sign for which w ≥ 0.
pub(super) fn put_quaternion(out: &mut Vec<u8>, key: &str, q: &Quaternion<f64>, decimals: u8) {
    put(out, "\"");
    put(out, key);
    let sign = 1.0_f64.copysign(q.w);
    let names = ["\":{\"x\":", ",\"y\":", ",\"z\":", ",\"w\":"];
    for (name, value) in names.into_iter().zip([q.i, q.j, q.k, q.w]) {
        put(out, name);
        push_fixed(out, sign * value, decimals);
    }
    put(out, "}");
}

/// `"timestamp":{"sec":…,"nsec":…}`.
pub(super) fn put_time(out: &mut Vec<u8>, t_ns: u64) {
    let (sec, nsec) = (t_ns / 1_000_000_000, t_ns % 1_000_000_000);
    put(out, "\"timestamp\":{\"sec\":");
    // Whole numbers far below 2^53.
    push_fixed(out, sec as f64, 0);
    put(out, ",\"nsec\":");
    push_fixed(out, nsec as f64, 0);
    put(out, "}");
}

/// A text between quotation marks.
pub(super) fn put_text(out: &mut Vec<u8>, text: &str) {
    put(out, "\"");
    for c in text.chars() {
        match c {
            '"' => put(out, "\\\""),
            '\\' => put(out, "\\\\"),
            c if u32::from(c) < 0x20 => put(out, &format!("\\u{:04x}", u32::from(c))),
            c => put(out, c.encode_utf8(&mut [0; 4])),
        }
    }
    put(out, "\"");
}

/// Kinds of primitives, as an entity has them.
const KINDS: [&str; 7] = [
    "metadata",
    "arrows",
    "cubes",
    "spheres",
    "cylinders",
    "lines",
    "triangles",
];

/// A thing of a scene.
#[derive(Debug, Clone)]
pub(super) struct Entity {
    digits: u8,
    /// Bodies of the arrays of [`KINDS`].
    arrays: [Vec<u8>; 7],
}

impl Entity {
    /// Nothing yet; lengths have this many digits.
    pub(super) fn new(digits: u8) -> Self {
        Self {
            digits,
            arrays: Default::default(),
        }
    }

    /// Begins the next element of an array.
    fn next(&mut self, kind: usize) -> &mut Vec<u8> {
        let array = &mut self.arrays[kind];
        put(array, if array.is_empty() { "{" } else { ",{" });
        array
    }

    /// A line of text, shown when the entity is selected.
    pub(super) fn tell(&mut self, key: &str, value: &str) {
        let out = self.next(0);
        put(out, "\"key\":");
        put_text(out, key);
        put(out, ",\"value\":");
        put_text(out, value);
        put(out, "}");
    }

    /// An arrow from a point, along a vector \[m\].
    pub(super) fn arrow(&mut self, from: &Vector3<f64>, along: &Vector3<f64>, colour: Colour) {
        let length = along.norm();
        // Rotation of X to the vector; any half turn if they are opposite.
        let turn =
            nalgebra::UnitQuaternion::rotation_between(&Vector3::x(), along).unwrap_or_else(|| {
                nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
            });
        let head = 0.02_f64.min(0.5 * length);
        let digits = self.digits;
        let out = self.next(1);
        put_pose(out, &Isometry3::from_parts((*from).into(), turn), digits);
        let sizes = [length - head, 0.006, head, 0.016];
        let names = [
            ",\"shaft_length\":",
            ",\"shaft_diameter\":",
            ",\"head_length\":",
            ",\"head_diameter\":",
        ];
        for (name, size) in names.into_iter().zip(sizes) {
            put(out, name);
            push_fixed(out, size, digits);
        }
        put_colour(out, colour);
        put(out, "}");
    }

    /// A box of these lengths about its middle \[m\].
    pub(super) fn cube(&mut self, at: &Isometry3<f64>, size: &Vector3<f64>, colour: Colour) {
        self.solid(2, at, size, "", colour);
    }

    /// An ellipsoid of these diameters \[m\].
    pub(super) fn sphere(&mut self, at: &Isometry3<f64>, size: &Vector3<f64>, colour: Colour) {
        self.solid(3, at, size, "", colour);
    }

    /// A cylinder about its middle, along Z \[m\].
    pub(super) fn cylinder(&mut self, at: &Isometry3<f64>, size: &Vector3<f64>, colour: Colour) {
        self.solid(4, at, size, ",\"bottom_scale\":1,\"top_scale\":1", colour);
    }

    /// A cone about the middle of its height, opening along Z \[m\].
    pub(super) fn cone(&mut self, at: &Isometry3<f64>, size: &Vector3<f64>, colour: Colour) {
        self.solid(4, at, size, ",\"bottom_scale\":0,\"top_scale\":1", colour);
    }

    fn solid(
        &mut self,
        kind: usize,
        at: &Isometry3<f64>,
        size: &Vector3<f64>,
        scales: &str,
        colour: Colour,
    ) {
        let digits = self.digits;
        let out = self.next(kind);
        put_pose(out, at, digits);
        put(out, ",");
        put_vector(out, "size", size, digits);
        put(out, scales);
        put_colour(out, colour);
        put(out, "}");
    }

    /// Separate lines between pairs of points \[m\], one pixel wide.
    pub(super) fn lines(&mut self, points: &[Vector3<f64>], colour: Colour) {
        let digits = self.digits;
        let out = self.next(5);
        put(out, "\"type\":2,");
        put_pose(out, &Isometry3::identity(), digits);
        put(out, ",\"thickness\":1,\"scale_invariant\":true");
        put_points(out, points, digits);
        put_colour(out, colour);
        put(out, ",\"colors\":[],\"indices\":[]}");
    }

    /// Triangles between points \[m\], by their numbers.
    pub(super) fn triangles(&mut self, points: &[Vector3<f64>], indices: &[usize], colour: Colour) {
        let digits = self.digits;
        let out = self.next(6);
        put_pose(out, &Isometry3::identity(), digits);
        put_points(out, points, digits);
        put_colour(out, colour);
        put(out, ",\"colors\":[],\"indices\":[");
        for (i, index) in indices.iter().enumerate() {
            put(out, &format!("{}{index}", if i > 0 { "," } else { "" }));
        }
        put(out, "]}");
    }

    /// Appends the entity: it belongs to a frame, moves with it, and stays until one of the same name
    /// replaces it.
    pub(super) fn write(&self, out: &mut Vec<u8>, t_ns: u64, frame: &str, id: &str) {
        put(out, "{");
        put_time(out, t_ns);
        put(out, ",\"frame_id\":");
        put_text(out, frame);
        put(out, ",\"id\":");
        put_text(out, id);
        put(
            out,
            ",\"lifetime\":{\"sec\":0,\"nsec\":0},\"frame_locked\":true",
        );
        for (kind, array) in KINDS.into_iter().zip(&self.arrays) {
            put(out, ",\"");
            put(out, kind);
            put(out, "\":[");
            out.extend_from_slice(array);
            put(out, "]");
        }
        put(out, ",\"texts\":[],\"models\":[]}");
    }

    /// Empties it; its room serves the next one.
    pub(super) fn clear(&mut self) {
        self.arrays.iter_mut().for_each(Vec::clear);
    }
}

fn put_pose(out: &mut Vec<u8>, at: &Isometry3<f64>, digits: u8) {
    put(out, "\"pose\":{");
    put_vector(out, "position", &at.translation.vector, digits);
    put(out, ",");
    put_quaternion(out, "orientation", at.rotation.quaternion(), digits);
    put(out, "}");
}

fn put_colour(out: &mut Vec<u8>, colour: Colour) {
    let names = [",\"color\":{\"r\":", ",\"g\":", ",\"b\":", ",\"a\":"];
    for (name, value) in names.into_iter().zip(colour) {
        put(out, name);
        push_fixed(out, value, 3);
    }
    put(out, "}");
}

fn put_points(out: &mut Vec<u8>, points: &[Vector3<f64>], digits: u8) {
    put(out, ",\"points\":[");
    for (i, point) in points.iter().enumerate() {
        if i > 0 {
            put(out, ",");
        }
        put_point(out, point, digits);
    }
    put(out, "]");
}

/// A whole update of a scene with these entities, which `write` appends, separated by commas.
pub(super) fn scene_update(out: &mut Vec<u8>, write: impl FnOnce(&mut Vec<u8>)) {
    put(out, "{\"deletions\":[],\"entities\":[");
    write(out);
    put(out, "]}");
}

//! The ground of a scenario: sections `[[terrain]]`, each a part with its material.
//!
//! Axes as in MODEL.md: the world's origin is the start place, x ahead, y to the left, z up. Parts add up: a
//! body touches each on its own. If no part reaches everywhere (`plane`, `heightmap`), the others lie on a
//! level floor of rock.

mod fields;
mod files;
mod height_map;
mod material;
mod rocks;
mod solids;

use std::ops::Range;

use wheeleg_plant::terrain::{
    Heap, Index, MOST_OVER_A_PLACE, Material, Part, Plane, Shape, Terrain, heap,
};

use super::quantity::pretty;
use super::reader::{Entry, Reader};
use fields::{Fields, angle, length};
pub use files::Data;
pub(crate) use files::{Files, named_files};

/// The ground of a scenario.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ground {
    /// For the plant.
    pub terrain: Terrain,
    /// Each part as in the file, for logs and reports.
    pub parts: Vec<String>,
    /// Index of the first part of each section in the terrain, and the section; in that order.
    begins: Vec<(usize, usize)>,
}

impl Ground {
    /// BLAKE3 of the terrain with everything made from data files and seeds, 64 hexadecimal digits; `None`
    /// for the plain floor of a scenario without parts.
    #[must_use]
    pub fn fingerprint(&self) -> Option<String> {
        let digest = || blake3::Hash::from(self.terrain.digest());
        (!self.parts.is_empty()).then(|| digest().to_hex().to_string())
    }

    /// Sections of the file, in the order of their parts in the terrain, each with those parts.
    pub fn sections(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let ends = self.begins.iter().skip(1).map(|(first, _)| *first);
        let ends = ends.chain([self.terrain.parts.len()]);
        let begins = self.begins.iter().zip(ends);
        begins.map(|((first, section), end)| (*section, *first..end))
    }
}

/// A kind of part.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Plane,
    Block,
    Step,
    Stairs,
    Ramp,
    Rocks,
    HeightMap,
}

const KINDS: [(&str, Kind); 7] = [
    ("plane", Kind::Plane),
    ("block", Kind::Block),
    ("step", Kind::Step),
    ("stairs", Kind::Stairs),
    ("ramp", Kind::Ramp),
    ("rocks", Kind::Rocks),
    ("heightmap", Kind::HeightMap),
];

impl Kind {
    /// Whether such a part gives ground everywhere by itself.
    fn is_everywhere(self) -> bool {
        matches!(self, Self::Plane | Self::HeightMap)
    }
}

/// Reads all parts; `top` are the fields at the top of the file.
pub(super) fn read(r: &mut Reader, top: &[&str], files: &Files<'_>) -> Ground {
    let mut parts = Vec::new();
    // With very many parts their entries would take as much memory again as the file itself: each is taken
    // out of it only when needed.
    let mut kinds = Vec::new();
    for i in 0..r.array_len("terrain") {
        let entry = r.entry("terrain", i);
        let kind = r.choice(&entry, "kind", &KINDS);
        parts.push(entry.text());
        kinds.extend(kind.map(|kind| (kind, i)));
    }
    let is_map = |(kind, _): &&(Kind, usize)| *kind == Kind::HeightMap;
    if let Some((_, second)) = kinds.iter().filter(is_map).nth(1) {
        let second = r.entry("terrain", *second);
        let message = format!("`{}`: a terrain has one heightmap at most", second.path);
        r.problem(Some(second.span.clone()), message, "the second", None);
    }
    // Parts that lie on the ground need the ground first.
    let (everywhere, lying): (Vec<_>, Vec<_>) = kinds
        .into_iter()
        .partition(|(kind, _)| kind.is_everywhere());
    let mut terrain = Terrain { parts: Vec::new() };
    // First part of each section.
    let mut begins = Vec::new();
    for (kind, i) in &everywhere {
        begins.push((terrain.parts.len(), *i));
        let entry = r.entry("terrain", *i);
        let added = part(r, *kind, &entry, (&terrain, files), top);
        terrain.parts.extend(added.unwrap_or_default());
    }
    if everywhere.is_empty() {
        terrain = Terrain::default();
    }
    let below = terrain.clone();
    for (kind, i) in &lying {
        begins.push((terrain.parts.len(), *i));
        let entry = r.entry("terrain", *i);
        let added = part(r, *kind, &entry, (&below, files), top);
        terrain.parts.extend(added.unwrap_or_default());
    }
    if let Some(heap) = heap(&terrain.parts, &Index::new(&terrain.parts)) {
        heaped(r, &heap, &begins);
    }
    Ground {
        terrain,
        parts,
        begins,
    }
}

/// Reports too many parts on top of each other, with the first excess one. `begins`: number of the first part
/// of each section, and of the section.
fn heaped(r: &mut Reader, heap: &Heap, begins: &[(usize, usize)]) {
    let section = |part: u32| {
        let after = begins.partition_point(|(first, _)| *first <= part as usize);
        begins[after.saturating_sub(1)].1
    };
    let mut sections: Vec<usize> = heap.parts.iter().map(|part| section(*part)).collect();
    sections.sort_unstable();
    sections.dedup();
    let (Some(first), Some(last)) = (sections.first(), sections.last()) else {
        return;
    };
    let entry = r.entry("terrain", *last);
    let fields = match entry.has("x") {
        true => format!("`{0}.x` and `{0}.y`", entry.path),
        false => format!("`{}`", entry.path),
    };
    let [x_m, y_m] = heap.place_m.map(pretty);
    r.problem(
        Some(entry.span.clone()),
        format!(
            "{fields}: more than {MOST_OVER_A_PLACE} parts of the ground, from `terrain[{first}]` to \
             `terrain[{last}]`, lie over one place, at x = {x_m} m, y = {y_m} m: allowed are 1 to \
             {MOST_OVER_A_PLACE}"
        ),
        "on top of the others",
        Some(
            "a body touches each part on its own: put them beside each other, or make one of them"
                .to_owned(),
        ),
    );
}

/// Reads one part; `below` is the ground under it, `files` its data files.
fn part(
    r: &mut Reader,
    kind: Kind,
    entry: &Entry,
    (below, files): (&Terrain, &Files<'_>),
    top: &[&str],
) -> Option<Vec<Part>> {
    let mut fields = Fields::new(entry, top);
    let material = material::read(r, &mut fields);
    let shapes = match kind {
        Kind::Plane => plane(r, &mut fields),
        Kind::Block => solids::block(r, &mut fields, below),
        Kind::Step => solids::step(r, &mut fields, below),
        Kind::Stairs => solids::stairs(r, &mut fields, below),
        Kind::Ramp => solids::ramp(r, &mut fields, below),
        Kind::Rocks => rocks::rocks(r, &mut fields, below),
        Kind::HeightMap => height_map::height_map(r, &mut fields, files),
    };
    fields.reject_others(r);
    Some(of(shapes?, material?))
}

/// These shapes, all of one material.
fn of(shapes: Vec<Shape>, material: Material) -> Vec<Part> {
    let part = |shape| Part { shape, material };
    shapes.into_iter().map(part).collect()
}

/// Steepest plane, degrees.
const STEEPEST_DEG: f64 = 60.0;

fn plane(r: &mut Reader, fields: &mut Fields<'_>) -> Option<Vec<Shape>> {
    let slope = angle(
        "slope",
        [-STEEPEST_DEG, STEEPEST_DEG],
        "how steeply the plane rises",
    );
    let azimuth = angle(
        "azimuth",
        [-360.0, 360.0],
        "direction in which the plane rises, from ahead to the left",
    );
    let height = length(
        "height",
        [-1000.0, 1000.0],
        "height of the plane at the start place",
    );
    let slope = fields.or(r, &slope, 0.0);
    let azimuth = fields.or(r, &azimuth, 0.0);
    let height = fields.or(r, &height, 0.0);
    let plane = match slope? {
        0.0 => Plane::level(height?),
        slope => Plane::sloping(slope, azimuth?).raised(height?),
    };
    Some(vec![Shape::Plane(plane)])
}

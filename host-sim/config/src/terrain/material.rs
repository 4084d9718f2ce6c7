//! Materials of the terrain.
//!
//! A hard material is recognized by its friction, a soil by its name.

use wheeleg_plant::soil::Soil;
use wheeleg_plant::terrain::Material;

use super::fields::{Fields, number};
use crate::reader::Reader;

/// Rubber on wet ice, ASSUMED.
const ICE: Material = Material {
    mu_static: 0.1,
    mu_kinetic: 0.05,
    soil: None,
};

/// Hard materials.
const HARD: [(&str, Material); 3] = [
    ("rock", Material::ROUGH),
    ("floor", Material::ROUGH),
    ("ice", ICE),
];

/// All named materials.
fn named() -> Vec<(&'static str, Material)> {
    let soils = Soil::NAMED.iter();
    let soft = soils.map(|(name, soil)| (*name, Material::soft(*soil)));
    HARD.into_iter().chain(soft).collect()
}

/// Reads `material`, a name or its frictions; rock if it is left out.
pub(super) fn read(r: &mut Reader, fields: &mut Fields<'_>) -> Option<Material> {
    if !fields.has("material") {
        return Some(Material::ROUGH);
    }
    let entry = fields.entry;
    let Some(table) = entry.table("material") else {
        return r.choice(entry, "material", &named());
    };
    let mut own = Fields::new(&table, &[]);
    let most = number("mu_static", [0.0, 10.0], "static friction");
    let mu_static = own.required(r, &most);
    let most = mu_static.unwrap_or(10.0);
    let kinetic = number(
        "mu_kinetic",
        [0.0, most],
        "kinetic friction, at most the static one",
    );
    let mu_kinetic = own.required(r, &kinetic);
    own.reject_others(r);
    Some(Material {
        mu_static: mu_static?,
        mu_kinetic: mu_kinetic?,
        soil: None,
    })
}

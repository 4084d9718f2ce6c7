//! Errors as the sources declare them.

use std::collections::BTreeSet;

/// Adds the variants of each error of a file: of those that derive `Diagnostic`, and of the others
/// that implement `Error`, derived or by hand. Types of `elsewhere` are left out.
pub(super) fn add(
    file: &syn::File,
    elsewhere: &[(&str, &str)],
    diagnostics: &mut BTreeSet<String>,
    reasons: &mut BTreeSet<String>,
) {
    let by_hand: Vec<String> = file.items.iter().filter_map(implements_error).collect();
    for item in &file.items {
        let (attributes, name) = match item {
            syn::Item::Enum(item) => (&item.attrs, item.ident.to_string()),
            syn::Item::Struct(item) => (&item.attrs, item.ident.to_string()),
            _ => continue,
        };
        let derives = |what: &str| {
            let mut derived = attributes.iter().filter(|a| a.path().is_ident("derive"));
            derived.any(|a| words(a).contains(what))
        };
        let is_diagnostic = derives("Diagnostic");
        let is_error = is_diagnostic || derives("Error") || by_hand.contains(&name);
        if !is_error || elsewhere.iter().any(|(other, _)| *other == name) {
            continue;
        }
        let list = if is_diagnostic {
            &mut *diagnostics
        } else {
            &mut *reasons
        };
        match item {
            syn::Item::Enum(item) => {
                for variant in &item.variants {
                    if is_diagnostic {
                        ensure_remedy(&variant.attrs, &variant.ident.to_string());
                    }
                    list.insert(format!("{name}::{}", variant.ident));
                }
            }
            _ => {
                if is_diagnostic {
                    ensure_remedy(attributes, &name);
                }
                list.insert(name);
            }
        }
    }
}

/// The type of an `impl Error for Type`.
fn implements_error(item: &syn::Item) -> Option<String> {
    let syn::Item::Impl(item) = item else {
        return None;
    };
    let (_, of, _) = item.trait_.as_ref()?;
    let syn::Type::Path(path) = &*item.self_ty else {
        return None;
    };
    let name = path.path.segments.last()?.ident.to_string();
    (of.segments.last()?.ident == "Error").then_some(name)
}

fn words(attribute: &syn::Attribute) -> String {
    attribute
        .meta
        .require_list()
        .map(|list| list.tokens.to_string())
        .unwrap_or_default()
}

fn ensure_remedy(attributes: &[syn::Attribute], name: &str) {
    let diagnostic = attributes
        .iter()
        .filter(|a| a.path().is_ident("diagnostic"));
    let said: String = diagnostic.map(words).collect();
    let whole = said.contains("transparent") || (said.contains("code") && said.contains("help"));
    assert!(whole, "{name}: {said}");
}

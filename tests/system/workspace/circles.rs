//! No import circles between the files of a crate.
//!
//! A file points at another when its code names an item defined there, directly or through re-exports.
//! Between a module and its own ancestors arrows may point both ways, so those do not count; neither does
//! code for tests alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree};

use super::{packages, root, text};

/// Known circles, by the names of their files from the root. A circle that is gone must leave the list; a
/// larger or new one fails the test.
const KNOWN: [&[&str]; 0] = [];

/// How many re-exports are followed to the definition.
const STEPS_MAX: usize = 8;

#[test]
fn files_import_each_other_one_way() {
    let (mut found, mut crates) = (Vec::new(), 0);
    for package in packages().into_values() {
        for target in package["targets"].as_array().expect("targets") {
            let kind = target["kind"][0].as_str().expect("a kind");
            if matches!(kind, "test" | "bench" | "example" | "custom-build") {
                continue;
            }
            let source = PathBuf::from(text(&target["src_path"]));
            let read = |path: &Path| fs::read_to_string(path).ok();
            let tree = Tree::read(&source, &read);
            found.extend(tree.circles());
            crates += 1;
        }
    }
    assert!(crates > 10, "only {crates} crates");
    let below = |path: &Path| {
        let path = path.strip_prefix(root()).expect("below the root");
        path.to_string_lossy().replace('\\', "/")
    };
    let mut gone: BTreeSet<_> = KNOWN.into_iter().collect();
    let mut unknown = String::new();
    for circle in found {
        let files: Vec<String> = circle.files.iter().map(|path| below(path)).collect();
        let known = |known: &&&[&str]| files.iter().all(|file| known.contains(&file.as_str()));
        if let Some(known) = KNOWN.iter().find(known) {
            gone.remove(known);
            continue;
        }
        unknown += &format!("\n&{files:?},\n");
        for (from, to, name) in &circle.arrows {
            unknown += &format!("    {} names {name} in {}\n", below(from), below(to));
        }
    }
    assert!(unknown.is_empty(), "circles of imports:{unknown}");
    assert!(gone.is_empty(), "no longer circles: {gone:#?}");
}

/// Files that import each other in a circle.
#[derive(Debug)]
struct Circle {
    files: Vec<PathBuf>,
    /// From, to, the name defined there.
    arrows: Vec<(PathBuf, PathBuf, String)>,
}

type Names = Vec<String>;

/// A module: a file or a part of one.
#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Its items.
    items: BTreeSet<String>,
    /// What it brings into scope: a name or `*`, with its path.
    uses: Vec<(String, Names)>,
    /// All paths in its code.
    paths: BTreeSet<Names>,
}

/// The modules of a crate, by their names from its root.
struct Tree<'a> {
    read: &'a dyn Fn(&Path) -> Option<String>,
    modules: BTreeMap<Names, Module>,
}

impl<'a> Tree<'a> {
    /// All modules below the file `source`, the root of a crate.
    fn read(source: &Path, read: &'a dyn Fn(&Path) -> Option<String>) -> Self {
        let mut tree = Self {
            read,
            modules: BTreeMap::new(),
        };
        let folder = source.parent().expect("a folder");
        tree.file(Vec::new(), source, folder);
        tree
    }

    /// The module in a file; those below it lie in `folder`.
    fn file(&mut self, names: Names, file: &Path, folder: &Path) {
        let text = (self.read)(file).unwrap_or_else(|| panic!("{}", file.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        self.module(names, file, folder, &parsed.items);
    }

    fn module(&mut self, names: Names, file: &Path, folder: &Path, items: &[Item]) {
        let mut module = Module {
            file: file.to_path_buf(),
            ..Module::default()
        };
        for item in items.iter().filter(|item| !is_for_tests(attributes(item))) {
            module.items.extend(name_of(item));
            module.visit_item(item);
            let Item::Mod(child) = item else { continue };
            let name = child.ident.to_string();
            let below = [names.clone(), vec![name.clone()]].concat();
            if let Some((_, items)) = &child.content {
                self.module(below, file, &folder.join(&name), items);
                continue;
            }
            let beside = file.parent().expect("a folder");
            let (own, inner) = (folder.join(format!("{name}.rs")), folder.join(&name));
            match place(&child.attrs) {
                Some(path) => {
                    let path = beside.join(path);
                    let folder = path.parent().expect("a folder").to_path_buf();
                    self.file(below, &path, &folder);
                }
                None if (self.read)(&own).is_some() => self.file(below, &own, &inner),
                None => self.file(below, &inner.join("mod.rs"), &inner),
            }
        }
        self.modules.insert(names, module);
    }

    /// The module that defines the item which `from` calls `path`; `None` for another crate.
    fn resolve(&self, from: &[String], path: &[String], steps: usize) -> Option<&[String]> {
        let steps = steps.checked_sub(1)?;
        let (mut at, mut rest) = (from.to_vec(), path);
        while let Some((first, tail)) = rest.split_first() {
            match first.as_str() {
                "crate" => at.clear(),
                "self" => {}
                "super" => drop(at.pop()),
                _ => break,
            }
            rest = tail;
        }
        while let Some((first, tail)) = rest.split_first() {
            let child = [at.as_slice(), std::slice::from_ref(first)].concat();
            if self.modules.contains_key(&child) {
                (at, rest) = (child, tail);
                continue;
            }
            let (key, module) = self.modules.get_key_value(&at)?;
            if module.items.contains(first) {
                return Some(key);
            }
            let named = module.uses.iter().filter(|(name, _)| name == first);
            let named = named.map(|(_, path)| [path, tail].concat());
            let globs = module.uses.iter().filter(|(name, _)| name == "*");
            let globs = globs.map(|(_, path)| [path, rest].concat());
            return named
                .chain(globs)
                .find_map(|path| self.resolve(&at, &path, steps));
        }
        self.modules
            .get_key_value(&at)
            .map(|(key, _)| key.as_slice())
    }

    /// Which file names which, with one of the names.
    fn arrows(&self) -> BTreeMap<(&Path, &Path), String> {
        let mut arrows = BTreeMap::new();
        // The module that is the whole file.
        let whole = |names: &[String]| {
            let file = &self.modules[names].file;
            let mut outer = names;
            while let Some((_, parent)) = outer.split_last()
                && self.modules[parent].file == *file
            {
                outer = parent;
            }
            outer.to_vec()
        };
        for (from, module) in &self.modules {
            for path in &module.paths {
                let Some(to) = self.resolve(from, path, STEPS_MAX) else {
                    continue;
                };
                let (a, b) = (whole(from), whole(to));
                if !a.starts_with(&b) && !b.starts_with(&a) {
                    let key = (module.file.as_path(), self.modules[to].file.as_path());
                    arrows.entry(key).or_insert_with(|| path.join("::"));
                }
            }
        }
        arrows
    }

    /// The circles: files that can all reach each other.
    fn circles(&self) -> Vec<Circle> {
        let arrows = self.arrows();
        let mut next: BTreeMap<&Path, Vec<&Path>> = BTreeMap::new();
        for (from, to) in arrows.keys() {
            next.entry(from).or_default().push(to);
        }
        let reached = |from: &Path| {
            let (mut found, mut open) = (BTreeSet::new(), next[from].clone());
            while let Some(at) = open.pop() {
                if found.insert(at) {
                    open.extend(next.get(at).into_iter().flatten());
                }
            }
            found
        };
        let reach: BTreeMap<&Path, BTreeSet<&Path>> =
            next.keys().map(|file| (*file, reached(file))).collect();
        let mut circles = BTreeSet::new();
        for (file, reached) in &reach {
            let back = |other: &&&Path| reach.get(*other).is_some_and(|r| r.contains(file));
            circles.insert(
                reached
                    .iter()
                    .filter(back)
                    .copied()
                    .collect::<BTreeSet<_>>(),
            );
        }
        circles.remove(&BTreeSet::new());
        let circle = |files: BTreeSet<&Path>| Circle {
            arrows: arrows
                .iter()
                .filter(|((a, b), _)| files.contains(a) && files.contains(b))
                .map(|((a, b), name)| (a.to_path_buf(), b.to_path_buf(), name.clone()))
                .collect(),
            files: files.into_iter().map(Path::to_path_buf).collect(),
        };
        circles.into_iter().map(circle).collect()
    }
}

/// `#[cfg(test)]`, `#[cfg(all(test, unix))]`.
fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let syn::Meta::List(list) = &attribute.meta else {
            return false;
        };
        let condition = list.tokens.to_string();
        let mut words = condition.split(|c: char| !c.is_alphanumeric());
        list.path.is_ident("cfg")
            && words.any(|word| word == "test")
            && !condition.starts_with("any")
            && !condition.contains("not")
    })
}

/// The file of `#[path = "file"]`.
fn place(attributes: &[Attribute]) -> Option<String> {
    attributes
        .iter()
        .find_map(|attribute| match &attribute.meta {
            syn::Meta::NameValue(pair) if pair.path.is_ident("path") => match &pair.value {
                syn::Expr::Lit(syn::ExprLit {
                    lit: syn::Lit::Str(text),
                    ..
                }) => Some(text.value()),
                _ => None,
            },
            _ => None,
        })
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Union(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

/// Name of an item for other modules.
fn name_of(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(i) => &i.ident,
        Item::Enum(i) => &i.ident,
        Item::Fn(i) => &i.sig.ident,
        Item::Macro(i) => i.ident.as_ref()?,
        Item::Static(i) => &i.ident,
        Item::Struct(i) => &i.ident,
        Item::Trait(i) => &i.ident,
        Item::Type(i) => &i.ident,
        Item::Union(i) => &i.ident,
        _ => return None,
    };
    Some(name.to_string())
}

impl Module {
    /// The paths of a `use`, one for each name that it brings into scope.
    fn import(&mut self, before: &[String], tree: &UseTree) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        let (name, path) = match tree {
            UseTree::Path(path) => return self.import(&with(&path.ident), &path.tree),
            UseTree::Group(group) => {
                return group
                    .items
                    .iter()
                    .for_each(|tree| self.import(before, tree));
            }
            UseTree::Glob(_) => ("*".to_owned(), before.to_vec()),
            UseTree::Name(name) if name.ident == "self" => {
                (before.last().cloned().unwrap_or_default(), before.to_vec())
            }
            UseTree::Name(name) => (name.ident.to_string(), with(&name.ident)),
            UseTree::Rename(name) if name.ident == "self" => {
                (name.rename.to_string(), before.to_vec())
            }
            UseTree::Rename(name) => (name.rename.to_string(), with(&name.ident)),
        };
        self.paths.insert(path.clone());
        self.uses.push((name, path));
    }

    /// The paths in the arguments of a macro.
    fn tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut colons): (Names, usize) = (Vec::new(), 0);
        for token in tokens {
            match token {
                TokenTree::Ident(name) => {
                    if colons != 2 && !path.is_empty() {
                        self.paths.insert(std::mem::take(&mut path));
                    }
                    path.push(name.to_string());
                    colons = 0;
                }
                TokenTree::Punct(punct) if punct.as_char() == ':' && !path.is_empty() => {
                    colons += 1;
                }
                other => {
                    if !path.is_empty() {
                        self.paths.insert(std::mem::take(&mut path));
                    }
                    colons = 0;
                    if let TokenTree::Group(group) = other {
                        self.tokens(group.stream());
                    }
                }
            }
        }
        if !path.is_empty() {
            self.paths.insert(path);
        }
    }
}

impl<'ast> Visit<'ast> for Module {
    fn visit_attribute(&mut self, _: &'ast Attribute) {}

    /// A module of its own.
    fn visit_item_mod(&mut self, _: &'ast syn::ItemMod) {}

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.import(&[], &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let names = path
                .segments
                .iter()
                .map(|segment| segment.ident.to_string());
            self.paths.insert(names.collect());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, called: &'ast syn::Macro) {
        self.visit_path(&called.path);
        self.tokens(called.tokens.clone());
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if !is_for_tests(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }
}

/// The circles of a made-up crate: file names and contents.
fn circles_of(files: &[(&str, &str)]) -> Vec<String> {
    let read = |path: &Path| {
        let file = files.iter().find(|(name, _)| Path::new(name) == path)?;
        Some(file.1.to_owned())
    };
    let tree = Tree::read(Path::new("src/lib.rs"), &read);
    let names = |circle: Circle| {
        let names = circle.files.iter().map(|file| file.display().to_string());
        names.collect::<Vec<_>>().join(" ")
    };
    tree.circles().into_iter().map(names).collect()
}

#[test]
fn a_circle_is_found_whatever_way_it_is_written() {
    let root = ("src/lib.rs", "mod a; mod b; mod c;");
    let none: [&str; 0] = [];
    // One way, with any names.
    let b = ("src/b.rs", "pub struct B; pub fn b() {}");
    for a in [
        "use crate::b::B;",
        "use super::b::{self, B as Other};",
        "fn a() { crate::b::b() }",
        "fn a() { println!(\"{}\", crate::b::b()) }",
        "use crate::b; fn a() { b::b() }",
    ] {
        let c = ("src/c.rs", "use crate::a; use std::fmt;");
        assert_eq!(circles_of(&[root, ("src/a.rs", a), b, c]), none, "{a}");
        // And back, by way of a third.
        let b = ("src/b.rs", "pub struct B; pub fn b() {} use crate::c;");
        for c in ["pub use super::a;", "pub use super::a::*;"] {
            let files = [root, ("src/a.rs", a), b, ("src/c.rs", c)];
            assert_eq!(
                circles_of(&files),
                ["src/a.rs src/b.rs src/c.rs"],
                "{a} {c}"
            );
        }
    }
}

#[test]
fn what_stands_elsewhere_is_found_through_re_exports() {
    let files = [
        ("src/lib.rs", "mod deep; mod far;"),
        ("src/deep/mod.rs", "mod in_it; pub use in_it::Thing;"),
        (
            "src/deep/in_it.rs",
            "pub struct Thing; use crate::far::FAR;",
        ),
        (
            "src/far.rs",
            "pub const FAR: u8 = 1; use crate::deep::Thing;",
        ),
    ];
    assert_eq!(circles_of(&files), ["src/deep/in_it.rs src/far.rs"]);
}

#[test]
fn parents_children_parts_of_a_file_and_tests_may_point_both_ways() {
    let files = [
        (
            "src/lib.rs",
            "mod a; mod b; pub use a::A; pub const ROOT: u8 = 0;",
        ),
        (
            "src/a.rs",
            "mod under; pub struct A; fn a() { under::f(crate::ROOT) }",
        ),
        (
            "src/a/under.rs",
            "use super::A; use crate::b::inner::f; mod own { use super::f; }",
        ),
        (
            "src/b.rs",
            "pub mod inner { pub fn f() { super::g() } } fn g() { inner::f() }
             #[cfg(test)] mod tests { use crate::a::under::f; }",
        ),
    ];
    assert!(circles_of(&files).is_empty(), "{:?}", circles_of(&files));
}

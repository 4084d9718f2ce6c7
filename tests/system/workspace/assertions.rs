//! Every test asserts something, and none is disabled.
//!
//! A test asserts if its body has a macro that can fail it (`assert…`, `prop_assert…`, `panic`), if it
//! calls a function of its file or test program that does, or if a panic is what it expects. Functions
//! of one name count as one there, so a test may pass that should not, never the other way round.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};

use super::{root, rust_files};

/// The only reason for which a test may be left out of the quick suite.
const LONG: &str = "ignore = \"long; `cargo xtask test` runs it\"";

/// Functions of one scope, tests among them. The tests of a crate see each other; a file of sources
/// sees itself.
#[derive(Default)]
struct Functions {
    /// Names used in the bodies of the functions of a name.
    names: BTreeMap<String, BTreeSet<String>>,
    /// Functions known to assert so far.
    asserting: BTreeSet<String>,
    /// File and name of each test.
    tests: Vec<(String, String)>,
    /// Tests that are left out, and not because they are long.
    switched_off: Vec<String>,
}

impl Functions {
    /// Takes the functions of a stream up, those inside of macros and of other functions too.
    fn read(&mut self, file: &str, stream: TokenStream) {
        let mut attributes = Vec::new();
        let mut tokens = stream.into_iter().peekable();
        while let Some(token) = tokens.next() {
            match token {
                TokenTree::Punct(punct) if punct.as_char() == '#' => {
                    if let Some(TokenTree::Group(group)) = tokens.peek() {
                        attributes.push(group.stream().to_string());
                    }
                }
                TokenTree::Punct(punct) if punct.as_char() == ';' => attributes.clear(),
                TokenTree::Ident(word) if word == "fn" => {
                    let Some(TokenTree::Ident(name)) = tokens.next() else {
                        continue;
                    };
                    let body = tokens.by_ref().find_map(|token| match token {
                        TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                            Some(Some(group))
                        }
                        TokenTree::Punct(punct) if punct.as_char() == ';' => Some(None),
                        _ => None,
                    });
                    if let Some(Some(body)) = body {
                        self.function(file, &name.to_string(), &attributes, &body);
                    }
                    attributes.clear();
                }
                TokenTree::Group(group) => {
                    if group.delimiter() == Delimiter::Brace {
                        attributes.clear();
                    }
                    self.read(file, group.stream());
                }
                _ => (),
            }
        }
    }

    fn function(&mut self, file: &str, name: &str, attributes: &[String], body: &Group) {
        let has = |wanted: &str| attributes.iter().any(|attribute| attribute == wanted);
        if has("test") {
            self.tests.push((file.to_owned(), name.to_owned()));
            let off = attributes.iter().find(|text| text.starts_with("ignore"));
            if off.is_some_and(|text| text != LONG) {
                self.switched_off.push(format!("{file}: {name}"));
            }
        }
        let names = self.names.entry(name.to_owned()).or_default();
        let mut fails = attributes
            .iter()
            .any(|text| text.starts_with("should_panic"));
        look(body.stream(), names, &mut fails);
        if fails {
            self.asserting.insert(name.to_owned());
        }
        self.read(file, body.stream());
    }

    /// Functions that call one that asserts do so themselves.
    fn close(&mut self) {
        loop {
            let before = self.asserting.len();
            for (name, names) in &self.names {
                if !names.is_disjoint(&self.asserting) {
                    self.asserting.insert(name.clone());
                }
            }
            if self.asserting.len() == before {
                return;
            }
        }
    }

    /// Tests without an assertion.
    fn idle(&self) -> Vec<String> {
        let idle = self
            .tests
            .iter()
            .filter(|(_, name)| !self.asserting.contains(name));
        idle.map(|(file, name)| format!("{file}: {name}")).collect()
    }
}

/// The names that are called in a body, and whether a macro in it can fail.
fn look(stream: TokenStream, names: &mut BTreeSet<String>, fails: &mut bool) {
    let mut tokens = stream.into_iter().peekable();
    while let Some(token) = tokens.next() {
        match token {
            TokenTree::Group(group) => look(group.stream(), names, fails),
            TokenTree::Ident(word) => {
                let word = word.to_string();
                match tokens.peek() {
                    Some(TokenTree::Punct(punct)) if punct.as_char() == '!' => {
                        let can_fail = ["assert", "prop_assert", "panic"];
                        *fails |= can_fail.iter().any(|begin| word.starts_with(begin));
                    }
                    // A call, with the types of a generic function between or without.
                    Some(TokenTree::Punct(punct)) if punct.as_char() == ':' => {
                        names.insert(word);
                    }
                    Some(TokenTree::Group(group))
                        if group.delimiter() == Delimiter::Parenthesis =>
                    {
                        names.insert(word);
                    }
                    _ => (),
                }
            }
            _ => (),
        }
    }
}

/// The scope of a file: the folder of tests that it is in, or itself.
fn scope(file: &str) -> &str {
    const TESTS: &str = "tests/";
    file.find(TESTS)
        .map_or(file, |at| &file[..at + TESTS.len()])
}

/// The functions of each scope.
fn of(texts: &[(String, String)]) -> Vec<Functions> {
    let mut scopes: BTreeMap<&str, Functions> = BTreeMap::new();
    for (file, text) in texts {
        let stream = text.parse().unwrap_or_else(|e| panic!("{file}: {e}"));
        scopes.entry(scope(file)).or_default().read(file, stream);
    }
    let mut all: Vec<Functions> = scopes.into_values().collect();
    all.iter_mut().for_each(Functions::close);
    all
}

#[test]
fn every_test_asserts_and_none_is_switched_off() {
    let suite = fs::read_to_string(root().join("xtask/src/rust.rs")).expect("the suite's step");
    assert!(suite.contains(".args([\"--\", \"--include-ignored\"])"));
    let scopes = of(&rust_files());
    let tests: usize = scopes.iter().map(|functions| functions.tests.len()).sum();
    assert!(tests > 1_500, "only {tests} tests found");
    let off: Vec<&String> = scopes.iter().flat_map(|f| &f.switched_off).collect();
    assert!(off.is_empty(), "switched off: {off:#?}");
    let idle: Vec<String> = scopes.iter().flat_map(Functions::idle).collect();
    assert!(idle.is_empty(), "without an assertion: {idle:#?}");
}

#[test]
fn a_test_that_proves_nothing_is_found() {
    let texts = [(
        "a.rs".to_owned(),
        r#"
        #[test] fn direct() { assert_eq!(1, 1); }
        #[test] fn by_a_helper() { let x = 1; through(x); }
        fn through(x: u8) { holds(x); }
        fn holds(x: u8) { if x > 1 { panic!("no") } }
        #[test] #[should_panic(expected = "no")] fn expected() { run(); }
        macro! { #[test] fn inside(x in any) { prop_assert!(x); } }
        #[test] fn idle() { let _ = run(); }
        #[test] #[ignore] fn off() { assert!(true); }
        mod inner { #[test] fn idle_too() { let holds = run(); holds.unwrap(); } }
        "#
        .to_owned(),
    )];
    let [functions] = &of(&texts)[..] else {
        panic!("one file");
    };
    assert_eq!(functions.tests.len(), 7);
    assert_eq!(functions.idle(), ["a.rs: idle", "a.rs: idle_too"]);
    assert_eq!(functions.switched_off, ["a.rs: off"]);
}

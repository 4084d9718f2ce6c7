//! The page is built in: a change of it builds this crate anew.

fn main() {
    println!("cargo:rerun-if-changed=../report/page");
}

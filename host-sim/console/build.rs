//! The page is built in: if it changes, this crate is rebuilt.

fn main() {
    println!("cargo:rerun-if-changed=../report/page");
}

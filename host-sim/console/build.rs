//! The page is built in: a file that is added to it is seen, too.

fn main() {
    println!("cargo::rerun-if-changed=../report/page");
}

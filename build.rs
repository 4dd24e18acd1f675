//! The page is a part of the program: where it was made anew the program is built anew.

fn main() {
    println!("cargo:rerun-if-changed=dashboard/dist");
}

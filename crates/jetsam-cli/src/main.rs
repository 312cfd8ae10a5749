//! The `jetsam` command.
fn main() {}

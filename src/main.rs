//! The `tomoswarm` command.

fn main() {}

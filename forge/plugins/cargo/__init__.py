"""Rust packages: the build types `ament_cargo` and `cargo`, and packages that have only a Cargo.toml."""

//! Nothing of ours: see Cargo.toml.

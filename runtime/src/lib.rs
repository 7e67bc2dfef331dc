//! A drone on a machine: its configuration and the files it is given.

pub mod diagnostic;
pub mod failure;
pub mod file;
pub mod geodetic;
pub mod identity;
pub mod journal;
pub mod mission_file;
pub mod plan;
pub mod schema;
pub mod text;
pub mod vehicle;

//! A drone on a machine: its configuration and the files it is given.

pub mod diagnostic;
pub mod geodetic;
pub mod journal;
pub mod mission_file;

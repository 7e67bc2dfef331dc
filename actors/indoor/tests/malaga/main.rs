//! Localisation on real data: 37 laser scans and a map of a floor of the University of Málaga.
//!
//! The data lies outside of the project, in `../shared/data` or in the folder `MUSTER_MALAGA`. Without it, these tests say that
//! they are skipped.

#[cfg(test)]
mod data;
#[cfg(test)]
mod localisation;

//! Flats: any text is a flat whose people walk inside, or refused with an error that can be shown.

use std::path::Path;

use muster_indoor_world::flat::{Flat, PEOPLE_MAX};

pub(super) fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match Flat::parse(Path::new("flat.toml"), text) {
        Ok(flat) => {
            assert!(flat.people.len() <= PEOPLE_MAX);
            let mut ways = flat.people.iter().flat_map(|person| &person.path);
            assert!(ways.all(|corner| flat.map.cell(*corner).is_some()));
        }
        Err(error) => assert!(!error.rendered().is_empty()),
    }
}

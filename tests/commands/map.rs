//! The commands `muster map`.

use std::fs;

use serde_json::Value;

use crate::support::muster;

#[test]
fn patrols_are_printed_for_programs_and_their_page_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let patrol = |seeds: &str| {
        let arguments = ["map", "patrol", "flat", "--json", "--seeds", seeds];
        let run = muster(folder.path(), &arguments);
        assert_eq!(run.status.code(), Some(0), "{run:?}");
        serde_json::from_slice::<Value>(&run.stdout).unwrap()
    };
    let printed = patrol("0..1");
    let [first] = printed["patrols"].as_array().unwrap().as_slice() else {
        panic!("one patrol: {printed}");
    };
    assert_eq!(
        (&first["seed"], &first["complete"]),
        (&0.into(), &true.into())
    );
    assert_eq!(first["touches_by_drone"], 0);
    assert!(first["clearance_m"].as_f64().unwrap() > 0.1, "{first}");
    let page = folder.path().join("runs/flat-patrol.html");
    let before = fs::read(&page).unwrap();
    patrol("1..2");
    assert_eq!(fs::read(&page).unwrap(), before);
    assert!(folder.path().join("runs/flat-patrol-2.html").exists());
}

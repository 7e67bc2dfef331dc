//! What `deploy/card` refuses to write, and to take for written. Nothing here needs root.

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

/// Bytes of the stand-in for an image: a table with one partition up to its end.
const IMAGE_LENGTH: usize = 2 * 1_024 * 1_024;

/// A table of partitions (MBR) whose only one begins after 1 MiB.
fn image() -> Vec<u8> {
    let mut image = vec![7; IMAGE_LENGTH];
    let (start, sectors) = (2_048_u32, 2_048_u32);
    let entry = [
        0x83_u32.to_le_bytes(),
        start.to_le_bytes(),
        sectors.to_le_bytes(),
    ]
    .concat();
    image[440..512].fill(0);
    image[450..462].copy_from_slice(&entry);
    image[510..512].copy_from_slice(&[0x55, 0xaa]);
    image
}

fn write(folder: &TempDir, card: &Path) -> (Option<i32>, String) {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/card");
    let mut command = Command::new("bash");
    command
        .arg(script)
        .arg(folder.path().join("image.img"))
        .arg(card);
    let output = command.output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    (output.status.code(), errors)
}

fn assert_refused(written: &(Option<i32>, String), expected: &str) {
    assert_eq!(written.0, Some(2), "{}", written.1);
    assert!(written.1.contains(expected), "{}", written.1);
}

#[test]
fn no_file_is_made_of_a_card_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("image.img"), image()).unwrap();
    let device = Path::new("/dev/muster-no-card");
    assert_refused(&write(&folder, device), "is no block device");
    assert!(!device.exists());
    let missing = folder.path().join("card");
    assert_refused(&write(&folder, &missing), "no file that exists");
    assert!(!missing.exists());
    assert_refused(
        &write(&folder, Path::new("/dev/null")),
        "is no block device",
    );
}

#[test]
fn an_image_that_is_cut_off_or_has_no_partitions_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let card = folder.path().join("card");
    File::create(&card).unwrap();
    let cut = &image()[..IMAGE_LENGTH - 4_096];
    fs::write(folder.path().join("image.img"), cut).unwrap();
    assert_refused(&write(&folder, &card), "is cut off: it has 2093056 bytes");
    fs::write(folder.path().join("image.img"), vec![0; IMAGE_LENGTH]).unwrap();
    assert_refused(&write(&folder, &card), "has no partitions");
}

#[test]
fn a_card_that_another_program_has_locked_is_refused_and_keeps_its_content() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("image.img"), image()).unwrap();
    let card = folder.path().join("card");
    fs::write(&card, "old").unwrap();
    let held = File::open(&card).unwrap();
    held.lock().unwrap();
    assert_refused(&write(&folder, &card), "another program has locked it");
    assert_eq!(fs::read_to_string(&card).unwrap(), "old");
}

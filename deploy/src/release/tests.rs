use std::io::Read;

use muster_runtime::identity::FleetKey;
use tempfile::TempDir;

use super::*;

/// Programs of both processors and a fleet, in a folder.
fn bench() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    Fleet::create(&folder.path().join("keys")).unwrap();
    for processor in PROCESSORS {
        let programs = folder.path().join("programs").join(processor);
        fs::create_dir_all(&programs).unwrap();
        for name in ["muster", "musterd"] {
            fs::write(programs.join(name), format!("{name} for {processor}")).unwrap();
        }
    }
    folder
}

fn pack(folder: &TempDir, out: &str) -> Result<Vec<PathBuf>, PackageError> {
    let path = folder.path();
    package(&PackageRequest {
        programs: &path.join("programs"),
        keys: &path.join("keys"),
        version: "0.2.0",
        out: &path.join(out),
        deb: true,
    })
}

fn fleet_key(folder: &TempDir) -> FleetKey {
    FleetKey::load(&folder.path().join("keys/fleet.pub")).unwrap()
}

#[test]
fn two_packages_of_the_same_programs_have_the_same_bytes() {
    let folder = bench();
    let (one, two) = (pack(&folder, "one").unwrap(), pack(&folder, "two").unwrap());
    assert_eq!(one.len(), 3, "an archive and two Debian packages");
    for (one, two) in one.iter().zip(&two) {
        assert_eq!(
            fs::read(one).unwrap(),
            fs::read(two).unwrap(),
            "{}",
            one.display()
        );
    }
}

#[test]
fn release_has_programs_units_and_versions() {
    let folder = bench();
    let written = pack(&folder, "out").unwrap();
    let release = Release::load(&written[0], &fleet_key(&folder)).unwrap();
    assert_eq!(release.processors().collect::<Vec<_>>(), PROCESSORS);
    assert_eq!(release.manifest.wire, [1, 2]);
    let unit = String::from_utf8(release.files["units/musterd@.service"].clone()).unwrap();
    assert!(unit.contains("ExecStart=/opt/muster/current/musterd --config /opt/muster/current/config/drone-%i.toml"), "{unit}");
    assert!(!unit.contains("/etc/muster") && !unit.contains("/usr/local"));
}

#[test]
fn an_empty_program_is_not_signed() {
    let folder = bench();
    let program = folder.path().join("programs/aarch64/musterd");
    fs::write(&program, "").unwrap();
    let refused = pack(&folder, "out").unwrap_err().to_string();
    assert!(refused.contains("is empty"), "{refused}");
    assert!(!folder.path().join("out").exists());
}

#[test]
fn debian_package_and_slots_share_no_path() {
    let unit = units::of_package();
    assert!(
        unit.contains("ExecStart=/usr/bin/musterd --config /etc/muster/drone-%i.toml"),
        "{unit}"
    );
    assert!(!unit.contains("/opt/muster"));
}

#[test]
fn altered_archive_is_refused_or_means_the_same() {
    let folder = bench();
    let written = pack(&folder, "out").unwrap();
    let bytes = fs::read(&written[0]).unwrap();
    let altered = folder.path().join("altered.tar.gz");
    let key = fleet_key(&folder);
    let (text, files) = {
        let whole = Release::load(&written[0], &key).unwrap();
        (whole.manifest_text, whole.files)
    };
    // A thousand places all over the archive. Bits of gzip's heading, and some that fill bytes, mean nothing.
    for at in (0..1_000).map(|nth| 10 + nth * (bytes.len() - 10) / 1_000) {
        let mut other = bytes.clone();
        other[at] ^= 0x10;
        fs::write(&altered, other).unwrap();
        if let Ok(read) = Release::load(&altered, &key) {
            assert!(
                read.manifest_text == text && read.files == files,
                "byte {at}"
            );
        }
    }
    let other = bench();
    let refused = Release::load(&written[0], &fleet_key(&other))
        .unwrap_err()
        .rendered();
    assert!(
        refused.contains("the signature does not match"),
        "{refused}"
    );
}

/// What is signed does not help if something else is packed.
#[test]
fn archive_with_another_file_than_its_manifest_names_is_refused() {
    let folder = bench();
    let written = pack(&folder, "out").unwrap();
    let key = fleet_key(&folder);
    let release = Release::load(&written[0], &key).unwrap();
    type Files = BTreeMap<String, Vec<u8>>;
    let plant = |change: &dyn Fn(&mut Files)| {
        let mut files = release.files.clone();
        change(&mut files);
        let mut bytes = Vec::new();
        archive::write(&release.manifest_text, &files, &mut bytes).unwrap();
        let path = folder.path().join("planted.tar.gz");
        fs::write(&path, bytes).unwrap();
        Release::load(&path, &key).unwrap_err().rendered()
    };
    for refused in [
        plant(&|files| files.get_mut("x86_64/musterd").unwrap().push(0)),
        plant(&|files| drop(files.remove("x86_64/muster"))),
        plant(&|files| drop(files.insert("x86_64/more".to_owned(), Vec::new()))),
    ] {
        assert!(
            refused.contains("other files than its manifest names"),
            "{refused}"
        );
    }
}

/// Without the key nobody can make a reader unpack gigabytes.
#[test]
fn archive_is_unpacked_only_as_far_as_its_manifest_is_signed() {
    let folder = bench();
    let written = pack(&folder, "out").unwrap();
    let release = Release::load(&written[0], &fleet_key(&folder)).unwrap();
    let mut files = release.files;
    // The end of the archive is cut off, so an error of reading shows how far it was read.
    files.insert("x86_64/more".to_owned(), vec![0; 1_024 * 1_024]);
    let mut bytes = Vec::new();
    archive::write(&release.manifest_text, &files, &mut bytes).unwrap();
    bytes.truncate(bytes.len() - 8);
    let path = folder.path().join("cut.tar.gz");
    fs::write(&path, bytes).unwrap();
    let other = bench();
    let refused = Release::load(&path, &fleet_key(&other)).unwrap_err();
    let refused = refused.rendered();
    assert!(
        refused.contains("the signature does not match"),
        "{refused}"
    );
    let refused = Release::load(&path, &fleet_key(&folder)).unwrap_err();
    let refused = refused.rendered();
    assert!(
        refused.contains("other files than its manifest names"),
        "{refused}"
    );
}

#[test]
fn archive_that_does_not_end_is_refused() {
    let folder = bench();
    let written = pack(&folder, "out").unwrap();
    let mut tar = Vec::new();
    let packed = fs::File::open(&written[0]).unwrap();
    flate2::read::GzDecoder::new(packed)
        .read_to_end(&mut tar)
        .unwrap();
    tar.resize(tar.len() + 1_024 * 1_024, 0);
    let path = folder.path().join("endless.tar.gz");
    let file = fs::File::create(&path).unwrap();
    let mut gzip = flate2::write::GzEncoder::new(file, flate2::Compression::default());
    io::Write::write_all(&mut gzip, &tar).unwrap();
    gzip.finish().unwrap();
    let refused = Release::load(&path, &fleet_key(&folder)).unwrap_err();
    let refused = refused.rendered();
    assert!(
        refused.contains("has data after its last file"),
        "{refused}"
    );
}

#[test]
fn no_secret_is_in_a_release() {
    let folder = bench();
    let secret = fs::read_to_string(folder.path().join("keys/fleet.key")).unwrap();
    let digits = secret.split_whitespace().last().unwrap();
    for path in pack(&folder, "out").unwrap() {
        let mut bytes = Vec::new();
        match path.extension().and_then(|it| it.to_str()) {
            Some("gz") => {
                let file = fs::File::open(&path).unwrap();
                flate2::read::GzDecoder::new(file)
                    .read_to_end(&mut bytes)
                    .unwrap();
            }
            _ => bytes = fs::read(&path).unwrap(),
        }
        let text = String::from_utf8_lossy(&bytes);
        assert!(!text.contains(digits) && !text.contains("muster-ed25519-secret"));
    }
}

#[test]
fn folder_without_programs_is_refused() {
    let folder = bench();
    fs::remove_file(folder.path().join("programs/aarch64/muster")).unwrap();
    let refused = pack(&folder, "out").unwrap_err().to_string();
    assert!(refused.contains("aarch64/muster"), "{refused}");
    fs::remove_dir_all(folder.path().join("programs")).unwrap();
    let refused = pack(&folder, "out").unwrap_err().to_string();
    assert!(refused.contains("neither a folder x86_64"), "{refused}");
}

//! A Debian package of a release, for hosts without `muster deploy`. It has paths of its own, so that both can be installed.

use std::io::{self, Write};

use super::archive::tar;

/// Debian's name of a processor. `None` if it has none here.
pub(super) fn architecture(processor: &str) -> Option<&'static str> {
    match processor {
        "x86_64" => Some("amd64"),
        "aarch64" => Some("arm64"),
        _ => None,
    }
}

/// What is packed.
pub(super) struct Contents<'a> {
    pub(super) version: &'a str,
    pub(super) architecture: &'a str,
    pub(super) muster: &'a [u8],
    pub(super) musterd: &'a [u8],
    /// The unit of drones.
    pub(super) unit: &'a str,
}

/// Creates the drones' user.
const POSTINST: &str = "#!/bin/sh
set -e
if ! getent passwd muster >/dev/null; then
    useradd --system --user-group --shell /usr/sbin/nologin --home-dir /var/lib/muster muster
fi
";

/// Writes the package.
pub(super) fn write(contents: &Contents<'_>, out: &mut dyn Write) -> io::Result<()> {
    let Contents {
        version,
        architecture,
        muster,
        musterd,
        unit,
    } = contents;
    let kib = (muster.len() + musterd.len()).div_ceil(1_024);
    let control = format!(
        "Package: muster\nVersion: {version}\nArchitecture: {architecture}\nMaintainer: muster <muster@localhost>\n\
         Installed-Size: {kib}\nDepends: libc6, passwd\nSection: net\nPriority: optional\n\
         Description: actor-based runtime for swarms of drones\n"
    );
    let packed = |files: &[(&str, &[u8])]| {
        let mut bytes = Vec::new();
        tar(files.iter().copied(), &mut bytes).map(|()| bytes)
    };
    let control = packed(&[
        ("control", control.as_bytes()),
        ("postinst", POSTINST.as_bytes()),
    ])?;
    let data = packed(&[
        ("usr/bin/muster", muster),
        ("usr/bin/musterd", musterd),
        ("usr/lib/systemd/system/musterd@.service", unit.as_bytes()),
    ])?;
    let mut archive = ar::Builder::new(out);
    for (name, content) in [
        ("debian-binary", &b"2.0\n"[..]),
        ("control.tar.gz", &control),
        ("data.tar.gz", &data),
    ] {
        let mut header = ar::Header::new(name.as_bytes().to_vec(), content.len() as u64);
        header.set_mode(0o100_644);
        archive.append(&header, content)?;
    }
    Ok(())
}

//! The units of a release. The drones' unit is the shipped one, with the paths of slots.

/// The drones' unit, as it is shipped: `/usr/local/bin/musterd` and `/etc/muster`.
const DRONES: &str = include_str!("../../../runtime/daemon/systemd/musterd@.service");
/// The unit that goes back at boot.
const BOOT: &str = include_str!("../../../runtime/daemon/systemd/muster-slots.service");

/// The units of a release, by name.
pub(super) fn of_slots() -> [(&'static str, String); 2] {
    let drones = with_paths("/opt/muster/current/musterd", "/opt/muster/current/config");
    [
        ("musterd@.service", drones),
        ("muster-slots.service", BOOT.to_owned()),
    ]
}

/// The drones' unit for a Debian package.
pub(super) fn of_package() -> String {
    with_paths("/usr/bin/musterd", "/etc/muster")
}

fn with_paths(program: &str, configuration: &str) -> String {
    DRONES
        .replace("/usr/local/bin/musterd", program)
        .replace("/etc/muster", configuration)
}

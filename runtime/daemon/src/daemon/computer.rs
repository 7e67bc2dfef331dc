//! The health of the computer: what a Raspberry Pi's kernel says of temperature, voltage and card, and the free space.
//!
//! A thread looks, so that neither a slow disk nor the Pi's firmware holds up the drone's thread.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use crate::status::ComputerStatus;

/// Time between two looks.
const PERIOD: Duration = Duration::from_secs(5);
/// The longest text that the kernel's files have, in bytes.
const TEXT_MAX: usize = 64;

/// What was seen last.
#[derive(Debug, Clone, Default)]
pub(super) struct Computer(Arc<Mutex<ComputerStatus>>);

impl Computer {
    /// Looks from now on, until the process ends. `folder`: where free space is needed.
    pub(super) fn watch(folder: &Path) -> io::Result<Self> {
        let folder: PathBuf = folder.to_owned();
        let computer = Self(Arc::new(Mutex::new(look(Path::new("/"), &folder))));
        let seen = Arc::downgrade(&computer.0);
        let watch = move || {
            while let Some(seen) = seen.upgrade() {
                let status = look(Path::new("/"), &folder);
                *seen.lock().unwrap_or_else(PoisonError::into_inner) = status;
                drop(seen);
                thread::sleep(PERIOD);
            }
        };
        thread::Builder::new()
            .name("computer".to_owned())
            .spawn(watch)?;
        Ok(computer)
    }

    pub(super) fn status(&self) -> ComputerStatus {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Looks at files below a root folder. What is not there, or says something else, is absent.
fn look(root: &Path, folder: &Path) -> ComputerStatus {
    let read = |path: &str| {
        let text = fs::read_to_string(root.join(path)).ok()?;
        (text.len() <= TEXT_MAX).then_some(text)
    };
    let throttled = read("sys/devices/platform/soc/soc:firmware/get_throttled");
    let flags = throttled.and_then(|text| flags(&text));
    let has = |bit: u32| flags.map(|flags| flags & (1 << bit) != 0);
    ComputerStatus {
        temperature_c: read("sys/class/thermal/thermal_zone0/temp").and_then(|it| celsius(&it)),
        // Bits as in Raspberry Pi's documentation of `vcgencmd get_throttled`.
        under_voltage: has(0),
        throttled: has(2),
        had_under_voltage: has(16),
        was_throttled: has(18),
        card_wear: read("sys/block/mmcblk0/device/life_time").and_then(|it| wear(&it)),
        free_bytes: free_bytes(folder),
    }
}

/// Degrees from thousandths of them.
fn celsius(text: &str) -> Option<f64> {
    let thousandths: i32 = text.trim().parse().ok()?;
    Some(f64::from(thousandths) / 1e3)
}

/// The firmware's flags, in hexadecimal.
fn flags(text: &str) -> Option<u32> {
    let text = text.trim();
    u32::from_str_radix(text.strip_prefix("0x").unwrap_or(text), 16).ok()
}

/// The wear of a card, from JEDEC's two estimates in tenths (1 is up to 10 %, 11 is more than
/// all of it). A card that does not say has 0.
fn wear(text: &str) -> Option<f64> {
    let estimates = text
        .split_whitespace()
        .map(|it| u8::from_str_radix(it.strip_prefix("0x")?, 16).ok());
    let tenths = estimates.collect::<Option<Vec<_>>>()?.into_iter().max()?;
    matches!(tenths, 1..=11).then(|| f64::from(tenths) / 10.0)
}

/// What users who are not root may still write.
fn free_bytes(folder: &Path) -> Option<u64> {
    let system = rustix::fs::statvfs(folder).ok()?;
    system.f_bavail.checked_mul(system.f_frsize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A root folder with these files.
    fn root(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a folder");
        for (path, text) in files {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            fs::write(path, text).expect("a file");
        }
        root
    }

    fn seen(files: &[(&str, &str)]) -> ComputerStatus {
        let root = root(files);
        look(root.path(), root.path())
    }

    const TEMPERATURE: &str = "sys/class/thermal/thermal_zone0/temp";
    const THROTTLED: &str = "sys/devices/platform/soc/soc:firmware/get_throttled";
    const WEAR: &str = "sys/block/mmcblk0/device/life_time";

    #[test]
    fn heat_low_voltage_and_wear_of_the_card_are_reported() {
        let files = [
            (TEMPERATURE, "84321\n"),
            (THROTTLED, "50005\n"),
            (WEAR, "0x02 0x0a\n"),
        ];
        let status = seen(&files);
        assert_eq!(status.temperature_c, Some(84.321));
        assert_eq!(status.under_voltage, Some(true));
        assert_eq!(status.throttled, Some(true));
        assert_eq!(status.card_wear, Some(1.0));
        assert!(status.free_bytes.is_some_and(|it| it > 0));
        let after = seen(&[(THROTTLED, "0x50000\n")]);
        assert_eq!(
            (after.under_voltage, after.had_under_voltage),
            (Some(false), Some(true))
        );
        assert_eq!(
            (after.throttled, after.was_throttled),
            (Some(false), Some(true))
        );
        let cold = seen(&[(TEMPERATURE, "-5000\n"), (THROTTLED, "0\n")]);
        assert_eq!(cold.temperature_c, Some(-5.0));
        assert_eq!(cold.had_under_voltage, Some(false));
    }

    #[test]
    fn absent_and_unreadable_files_are_absent_values() {
        let nothing = ComputerStatus {
            free_bytes: None,
            ..seen(&[])
        };
        assert_eq!(nothing, ComputerStatus::default());
        let long = "1".repeat(TEXT_MAX + 1);
        for text in ["", "\n", "none", "0x", "0x00 0x00", "99999999999", &long] {
            let files = [(TEMPERATURE, text), (WEAR, text)];
            let status = seen(&files);
            assert_eq!(
                (status.temperature_c, status.card_wear),
                (None, None),
                "{text}"
            );
        }
        assert_eq!(seen(&[(THROTTLED, "xyz")]).under_voltage, None);
        assert_eq!(free_bytes(Path::new("/nowhere/at/all")), None);
    }
}

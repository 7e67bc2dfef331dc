//! A host's slots on its disk. Every change is atomic and survives a power cut.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};

use muster_runtime::file::{Lock, replace, sync_folder_of};
use serde::{Deserialize, Serialize};

use super::facts::SlotFacts;
use super::machine::{Goal, SlotId, SlotLink, Slots, Step};

/// Folder of an unfinished slot.
const INCOMING: &str = ".incoming";
/// Folder of a slot that is being removed.
const OUTGOING: &str = ".outgoing";

/// Why a release was taken back last.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// The slot.
    pub slot: String,
    /// The reason, in words.
    pub why: String,
}

/// The places of a host.
#[derive(Debug, Clone)]
pub(super) struct Disk {
    root: PathBuf,
}

impl Disk {
    /// The slots below a root folder: `/`, or another for tests.
    pub(super) fn at(root: &Path) -> Self {
        Self {
            root: root.to_owned(),
        }
    }

    /// The folder of everything here.
    pub(super) fn home(&self) -> PathBuf {
        self.root.join("opt/muster")
    }

    /// The folder of a slot.
    pub(super) fn slot(&self, slot: &str) -> PathBuf {
        self.home().join("slots").join(slot)
    }

    /// A drone's file in a slot.
    pub(super) fn drone_file(&self, slot: &str, drone: u32) -> PathBuf {
        let name = format!("config/drone-{drone}.toml");
        self.slot(slot).join(name)
    }

    /// Where systemd looks for a unit of the administrator.
    pub(super) fn unit(&self, name: &str) -> PathBuf {
        self.root.join("etc/systemd/system").join(name)
    }

    pub(super) fn link(&self, link: SlotLink) -> PathBuf {
        self.home().join(match link {
            SlotLink::Current => "current",
            SlotLink::Good => "good",
            SlotLink::Previous => "previous",
        })
    }

    fn failure_path(&self) -> PathBuf {
        self.home().join("last-failure.json")
    }

    /// Creates the folders, if they are not there.
    pub(super) fn create(&self) -> io::Result<()> {
        let mut builder = DirBuilder::new();
        builder.recursive(true).mode(0o755);
        builder.create(self.home().join("slots"))?;
        // Whatever the mask of this process is: the drones' user must get there.
        for folder in [self.home(), self.home().join("slots")] {
            open_to_all(&folder)?;
        }
        builder.create(self.root.join("etc/systemd/system"))
    }

    /// What is there. A folder without links is a host without slots.
    pub(super) fn slots(&self) -> io::Result<Slots> {
        let mut slots = Slots::default();
        let entries = match fs::read_dir(self.home().join("slots")) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(slots),
            entries => entries?,
        };
        for entry in entries {
            let name = entry?.file_name().to_string_lossy().into_owned();
            if !name.starts_with('.') {
                slots.complete.insert(name);
            }
        }
        // A link that leads nowhere counts as none.
        let target = |link| {
            let target = fs::read_link(self.link(link)).ok()?;
            let name = target.file_name()?.to_string_lossy().into_owned();
            slots.complete.contains(&name).then_some(name)
        };
        let (current, good) = (target(SlotLink::Current), target(SlotLink::Good));
        let previous = target(SlotLink::Previous);
        Ok(Slots {
            current,
            good,
            previous,
            ..slots
        })
    }

    /// Carries out steps until the goal is reached.
    pub(super) fn reach(&self, goal: &Goal) -> io::Result<Slots> {
        loop {
            let slots = self.slots()?;
            match slots.next(goal) {
                Some(step) => self.carry_out(&step)?,
                None => return Ok(slots),
            }
        }
    }

    fn carry_out(&self, step: &Step) -> io::Result<()> {
        match step {
            Step::Set(link, None) => {
                fs::remove_file(self.link(*link))?;
                sync_folder_of(&self.link(*link))
            }
            Step::Set(link, Some(slot)) => {
                let (path, new) = (self.link(*link), self.link(*link).with_extension("new"));
                remove_if_there(&new)?;
                let target = Path::new("slots").join(slot);
                let good = self.link(SlotLink::Good);
                if fs::read_link(&good).is_ok_and(|it| it == target) {
                    // A second name of the link that is there needs no space, so a rollback works on a full disk.
                    fs::hard_link(&good, &new)?;
                } else {
                    symlink(target, &new)?;
                }
                fs::rename(&new, &path)?;
                sync_folder_of(&path)
            }
            Step::Remove(slot) => {
                // Renamed first, so that a slot with a name has all its files.
                let outgoing = self.slot(OUTGOING);
                remove_all_if_there(&outgoing)?;
                fs::rename(self.slot(slot), &outgoing)?;
                sync_folder_of(&outgoing)?;
                remove_all_if_there(&outgoing)
            }
        }
    }

    /// An empty folder for a slot's files.
    pub(super) fn new_incoming(&self) -> io::Result<PathBuf> {
        let incoming = self.slot(INCOMING);
        remove_all_if_there(&self.slot(OUTGOING))?;
        remove_all_if_there(&incoming)?;
        fs::create_dir(&incoming)?;
        open_to_all(&incoming)?;
        Ok(incoming)
    }

    /// Gives the finished folder of a slot its name. All its files must have been synced.
    pub(super) fn finish_incoming(&self, slot: &SlotId) -> io::Result<()> {
        let incoming = self.slot(INCOMING);
        File::open(&incoming)?.sync_all()?;
        fs::rename(&incoming, self.slot(slot))?;
        sync_folder_of(&self.slot(slot))
    }

    /// Removes an unfinished slot.
    pub(super) fn drop_incoming(&self) -> io::Result<()> {
        remove_all_if_there(&self.slot(INCOMING))
    }

    /// What a slot's file says of it.
    pub(super) fn facts(&self, slot: &str) -> io::Result<SlotFacts> {
        let text = fs::read(self.slot(slot).join("slot.json"))?;
        serde_json::from_slice(&text).map_err(io::Error::from)
    }

    /// Why a release was taken back last. `None` if none was since the last one that proved itself.
    pub(super) fn failure(&self) -> Option<Failure> {
        serde_json::from_slice(&fs::read(self.failure_path()).ok()?).ok()
    }

    /// Notes why a slot is taken back; the first reason counts.
    pub(super) fn set_failure(&self, slot: &str, why: &str) -> io::Result<()> {
        if self.failure().is_some_and(|it| it.slot == slot) {
            return Ok(());
        }
        let (slot, why) = (slot.to_owned(), why.to_owned());
        let json = serde_json::to_vec(&Failure { slot, why })?;
        replace(&self.failure_path(), &json)
    }

    /// Forgets why a slot was taken back: it is tried again.
    pub(super) fn clear_failure_of(&self, slot: &str) -> io::Result<()> {
        match self.failure() {
            Some(failure) if failure.slot == slot => self.clear_failure(),
            _ => Ok(()),
        }
    }

    /// Forgets the last failure.
    pub(super) fn clear_failure(&self) -> io::Result<()> {
        remove_if_there(&self.failure_path())
    }

    /// Locks the slots against a second operator, or a second trial. `None` if another process has the lock.
    pub(super) fn try_lock(&self, name: &str) -> io::Result<Option<Lock>> {
        let mut options = OpenOptions::new();
        let path = self.home().join(name);
        options.create(true).write(true).truncate(false);
        let file = options.mode(0o600).open(path)?;
        // Who can open it can hold it. An older release let everyone.
        file.set_permissions(Permissions::from_mode(0o600))?;
        Lock::of(&file)
    }

    /// Copies a slot's unit to systemd's folder, or removes it there, if it is a slot's. Returns whether that changed anything.
    pub(super) fn set_unit(&self, name: &str, slot: Option<&str>) -> io::Result<bool> {
        let unit = self.unit(name);
        let is = fs::read(&unit).ok();
        let Some(slot) = slot else {
            // One that is of no slot was put there by hand.
            let slots = self.slots()?.complete;
            let mut of_slots = slots
                .iter()
                .filter_map(|it| fs::read(self.slot(it).join(name)).ok());
            let is_of_a_slot = of_slots.any(|it| is.as_ref() == Some(&it));
            if is_of_a_slot {
                remove_if_there(&unit)?;
            }
            return Ok(is_of_a_slot);
        };
        let should = fs::read(self.slot(slot).join(name))?;
        if is.as_ref() == Some(&should) {
            return Ok(false);
        }
        replace(&unit, &should)?;
        Ok(true)
    }
}

/// Lets everyone enter and read a folder, whatever the mask of this process is.
pub(super) fn open_to_all(folder: &Path) -> io::Result<()> {
    fs::set_permissions(folder, Permissions::from_mode(0o755))
}

fn remove_if_there(path: &Path) -> io::Result<()> {
    if_there(fs::remove_file(path))
}

fn remove_all_if_there(path: &Path) -> io::Result<()> {
    if_there(fs::remove_dir_all(path))
}

fn if_there(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disk() -> (tempfile::TempDir, Disk) {
        let folder = tempfile::tempdir().unwrap();
        let disk = Disk::at(folder.path());
        disk.create().unwrap();
        (folder, disk)
    }

    fn install(disk: &Disk, slot: &str) {
        let incoming = disk.new_incoming().unwrap();
        fs::write(incoming.join("musterd"), slot).unwrap();
        disk.finish_incoming(&slot.to_owned()).unwrap();
    }

    fn running(disk: &Disk) -> String {
        fs::read_to_string(disk.link(SlotLink::Current).join("musterd")).unwrap()
    }

    #[test]
    fn links_lead_to_the_slot_that_runs() {
        let (_folder, disk) = disk();
        assert_eq!(disk.slots().unwrap(), Slots::default());
        install(&disk, "a");
        disk.reach(&Goal::Try("a".to_owned())).unwrap();
        assert!(disk.slots().unwrap().is_on_trial());
        disk.reach(&Goal::Keep).unwrap();
        install(&disk, "b");
        disk.reach(&Goal::Try("b".to_owned())).unwrap();
        assert_eq!(running(&disk), "b");
        disk.reach(&Goal::Settle).unwrap();
        assert_eq!(running(&disk), "a");
        assert!(!disk.slot("b").exists());
    }

    #[test]
    fn rollback_needs_no_new_file() {
        use std::os::unix::fs::MetadataExt;

        let (_folder, disk) = disk();
        install(&disk, "a");
        for goal in [Goal::Try("a".to_owned()), Goal::Keep] {
            disk.reach(&goal).unwrap();
        }
        install(&disk, "b");
        disk.reach(&Goal::Try("b".to_owned())).unwrap();
        disk.reach(&Goal::Settle).unwrap();
        let file = |link| fs::symlink_metadata(disk.link(link)).unwrap().ino();
        assert_eq!(
            file(SlotLink::Current),
            file(SlotLink::Good),
            "on a full disk there is none"
        );
        install(&disk, "c");
        for goal in [Goal::Try("c".to_owned()), Goal::Keep, Goal::RollBack] {
            disk.reach(&goal).unwrap();
        }
        assert_eq!(running(&disk), "a");
    }

    #[test]
    fn only_root_can_hold_a_lock() {
        let (_folder, disk) = disk();
        let path = disk.home().join("lock");
        fs::write(&path, "").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o644)).unwrap();
        let _lock = disk.try_lock("lock").unwrap().unwrap();
        let permissions = fs::metadata(path).unwrap().permissions();
        assert_eq!(permissions.mode() & 0o777, 0o600);
    }

    #[test]
    fn unfinished_slot_is_none_and_makes_room_for_the_next() {
        let (_folder, disk) = disk();
        let incoming = disk.new_incoming().unwrap();
        fs::write(incoming.join("musterd"), "half").unwrap();
        assert_eq!(disk.slots().unwrap(), Slots::default());
        install(&disk, "a");
        assert_eq!(disk.slots().unwrap().complete.len(), 1);
    }

    #[test]
    fn first_reason_of_a_failure_is_kept() {
        let (_folder, disk) = disk();
        disk.set_failure("a", "it crashed").unwrap();
        disk.set_failure("a", "the trial ended").unwrap();
        assert_eq!(disk.failure().unwrap().why, "it crashed");
        disk.set_failure("b", "unhealthy").unwrap();
        assert_eq!(disk.failure().unwrap().slot, "b");
        disk.clear_failure().unwrap();
        assert_eq!(disk.failure(), None);
    }

    #[test]
    fn second_operator_is_locked_out_until_the_first_is_gone() {
        let (_folder, disk) = disk();
        let first = disk.try_lock("lock").unwrap();
        assert!(first.is_some());
        assert!(disk.try_lock("lock").unwrap().is_none());
        drop(first);
        assert!(disk.try_lock("lock").unwrap().is_some());
    }
}

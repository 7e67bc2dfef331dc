//! Changes of a card, all of them or none.

use std::fs::{self, Permissions};
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};

use muster_runtime::diagnostic::BadInput;
use tempfile::NamedTempFile;

use super::ImageError;

/// A change.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Edit {
    path: PathBuf,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Kind {
    /// Replaces the file.
    Write(Content),
    /// Makes the folder if it is not there.
    Folder { mode: u32, owner: (u32, u32) },
    /// Moves it here.
    Rename { from: PathBuf },
    /// Leads to another path.
    Link { to: String },
    /// Removes it if it is there.
    Remove,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Content {
    text: String,
    /// `None`: as it was, or as the file system has it.
    mode: Option<u32>,
    /// `None`: as it was.
    owner: Option<(u32, u32)>,
}

/// What puts a change back.
enum Undo {
    Restore {
        path: PathBuf,
        content: Vec<u8>,
        mode: u32,
        owner: (u32, u32),
    },
    Relink {
        path: PathBuf,
        to: PathBuf,
    },
    Remove {
        path: PathBuf,
    },
    RemoveFolder {
        path: PathBuf,
    },
    Rename {
        from: PathBuf,
        to: PathBuf,
    },
}

impl Edit {
    fn new(path: &Path, kind: Kind) -> Self {
        let path = path.to_owned();
        Self { path, kind }
    }

    /// A file with these permissions, or those that it has.
    pub(super) fn write(path: &Path, text: String, mode: Option<u32>) -> Self {
        let owner = None;
        Self::new(path, Kind::Write(Content { text, mode, owner }))
    }

    /// A file that keeps its owner and permissions.
    pub(super) fn kept(path: &Path, text: String) -> Self {
        Self::write(path, text, None)
    }

    pub(super) fn owned(path: &Path, text: String, mode: u32, owner: (u32, u32)) -> Self {
        let (mode, owner) = (Some(mode), Some(owner));
        Self::new(path, Kind::Write(Content { text, mode, owner }))
    }

    pub(super) fn folder(path: &Path, mode: u32, owner: (u32, u32)) -> Self {
        Self::new(path, Kind::Folder { mode, owner })
    }

    pub(super) fn rename(from: &Path, to: &Path) -> Self {
        let from = from.to_owned();
        Self::new(to, Kind::Rename { from })
    }

    pub(super) fn link(path: &Path, to: &str) -> Self {
        let to = to.to_owned();
        Self::new(path, Kind::Link { to })
    }

    pub(super) fn remove(path: &Path) -> Self {
        Self::new(path, Kind::Remove)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Refuses a link of the card, which would lead to a file of this machine. `partitions`: their folders.
    pub(super) fn refuse_links(&self, partitions: [&Path; 2]) -> Result<(), BadInput> {
        let (written, moved) = match &self.kind {
            Kind::Write(_) => (Some(self.path()), None),
            Kind::Rename { from } => (None, Some(from.as_path())),
            Kind::Folder { .. } | Kind::Link { .. } | Kind::Remove => (None, None),
        };
        let folders = [Some(self.path()), moved].into_iter().flatten();
        let folders = folders.flat_map(|path| path.ancestors().skip(1));
        let folders = folders.filter(|path| {
            let is_inside = |it: &&Path| path != it && path.starts_with(it);
            partitions.iter().any(is_inside)
        });
        for path in folders.chain(written) {
            if path.is_symlink() {
                let help =
                    "begin with a stock Raspberry Pi OS Lite card: it has a folder or a file there";
                return Err(BadInput::without_excerpt(path, "is a symbolic link", help));
            }
        }
        Ok(())
    }

    fn carry_out(&self, undos: &mut Vec<Undo>) -> io::Result<()> {
        if let Some(parent) = self.path.parent() {
            make_folders(parent, undos)?;
        }
        let was = Undo::of(&self.path)?;
        match &self.kind {
            Kind::Write(content) => {
                undos.push(was);
                content.replace(&self.path)?;
            }
            Kind::Folder { .. } if self.path.is_dir() => {}
            Kind::Folder { mode, owner } => {
                make_folders(&self.path, undos)?;
                chown(&self.path, Some(owner.0), Some(owner.1))?;
                fs::set_permissions(&self.path, Permissions::from_mode(*mode))?;
            }
            Kind::Rename { from } => {
                fs::rename(from, &self.path)?;
                let (from, to) = (self.path.clone(), from.clone());
                undos.push(Undo::Rename { from, to });
            }
            Kind::Link { to } => {
                undos.push(was);
                remove(&self.path)?;
                symlink(to, &self.path)?;
            }
            Kind::Remove => {
                undos.push(was);
                remove(&self.path)?;
            }
        }
        Ok(())
    }
}

impl Content {
    /// Replaces a file whole.
    fn replace(&self, path: &Path) -> io::Result<()> {
        let old = fs::metadata(path).ok();
        let folder = path.parent().unwrap_or(Path::new("."));
        let mut file = NamedTempFile::new_in(folder)?;
        file.write_all(self.text.as_bytes())?;
        let mode = self
            .mode
            .or_else(|| old.as_ref().map(|it| it.mode() & 0o7777));
        let owner = self
            .owner
            .or_else(|| old.as_ref().map(|it| (it.uid(), it.gid())));
        if let Some((user, group)) = owner {
            chown(file.path(), Some(user), Some(group))?;
        }
        // A FAT partition has no permissions to set.
        if let Some(mode) = mode {
            fs::set_permissions(file.path(), Permissions::from_mode(mode))?;
        }
        file.as_file().sync_all()?;
        file.persist(path)?;
        Ok(())
    }
}

impl Undo {
    /// Puts a path back as it is now.
    fn of(path: &Path) -> io::Result<Self> {
        let path = path.to_owned();
        let metadata = match fs::symlink_metadata(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Ok(Self::Remove { path });
            }
            metadata => metadata?,
        };
        if metadata.is_symlink() {
            let to = fs::read_link(&path)?;
            return Ok(Self::Relink { path, to });
        }
        if metadata.is_dir() {
            return Ok(Self::RemoveFolder { path });
        }
        Ok(Self::Restore {
            content: fs::read(&path)?,
            mode: metadata.mode() & 0o7777,
            owner: (metadata.uid(), metadata.gid()),
            path,
        })
    }

    fn carry_out(&self) -> io::Result<()> {
        match self {
            Self::Restore {
                path,
                content,
                mode,
                owner,
            } => {
                fs::write(path, content)?;
                chown(path, Some(owner.0), Some(owner.1))?;
                fs::set_permissions(path, Permissions::from_mode(*mode))
            }
            Self::Relink { path, to } => remove(path).and_then(|()| symlink(to, path)),
            Self::Remove { path } => remove(path),
            Self::RemoveFolder { path } => fs::remove_dir(path),
            Self::Rename { from, to } => fs::rename(from, to),
        }
    }
}

/// Makes a folder and those above it.
fn make_folders(path: &Path, undos: &mut Vec<Undo>) -> io::Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    if let Some(parent) = path.parent() {
        make_folders(parent, undos)?;
    }
    fs::create_dir(path)?;
    let path = path.to_owned();
    undos.push(Undo::RemoveFolder { path });
    Ok(())
}

fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Makes all changes, or puts back those that were made.
pub(super) fn carry_out(edits: &[Edit]) -> Result<(), ImageError> {
    let mut undos = Vec::new();
    for edit in edits {
        if let Err(source) = edit.carry_out(&mut undos) {
            for undo in undos.iter().rev() {
                // A card that refuses this, too, is beyond help; the error names the file.
                let _ = undo.carry_out();
            }
            let path = edit.path.clone();
            return Err(ImageError::Write { path, source });
        }
    }
    Ok(())
}

//! The default user becomes the operator, without a password.

use std::path::Path;

use muster_daemon::audit::DEFAULT_USER as DEFAULT;
use muster_runtime::diagnostic::{BadInput, read_text};

use super::Card;
use super::edit::Edit;

/// The files that name users first in a line, and whether they may be absent.
const FILES: [(&str, bool); 6] = [
    ("etc/passwd", false),
    ("etc/shadow", false),
    ("etc/group", false),
    ("etc/gshadow", true),
    ("etc/subuid", true),
    ("etc/subgid", true),
];

/// Changes of the users. None if the operator is there already.
pub(super) fn edits(root: &Path, card: &Card) -> Result<Vec<Edit>, BadInput> {
    let passwd = root.join("etc/passwd");
    let users = read_text(&passwd)?;
    match (has_user(&users, DEFAULT), has_user(&users, &card.user)) {
        (true, false) => {}
        (false, true) => return Ok(Vec::new()),
        (true, true) => {
            let message = format!("both {DEFAULT} and {} are users of this card", card.user);
            let help = "begin with a stock card, or name another --user";
            return Err(BadInput::without_excerpt(&passwd, message, help));
        }
        (false, false) => {
            let message = format!("the default user {DEFAULT} is not there");
            let help = "begin with a stock Raspberry Pi OS Lite card";
            return Err(BadInput::without_excerpt(&passwd, message, help));
        }
    }
    let groups = root.join("etc/group");
    if has_user(&read_text(&groups)?, &card.user) {
        let message = format!("{} is a group of this card, and no user", card.user);
        let help = "name another --user: the user gets a group of the same name";
        return Err(BadInput::without_excerpt(&groups, message, help));
    }
    let mut edits = Vec::new();
    for (name, may_be_absent) in FILES {
        let path = root.join(name);
        if may_be_absent && !path.exists() {
            continue;
        }
        edits.push(Edit::kept(
            &path,
            renamed(&read_text(&path)?, name, &card.user),
        ));
    }
    let home = root.join("home");
    edits.push(Edit::rename(&home.join(DEFAULT), &home.join(&card.user)));
    edits.push(Edit::remove(&root.join("etc/sudoers.d/010_pi-nopasswd")));
    let sudo = format!("{} ALL=(ALL) NOPASSWD: ALL\n", card.user);
    edits.push(Edit::write(
        &root.join("etc/sudoers.d/010_muster"),
        sudo,
        Some(0o440),
    ));
    Ok(edits)
}

/// Numbers of the operator and its group.
pub(super) fn home(root: &Path, card: &Card) -> Result<(u32, u32), BadInput> {
    let path = root.join("etc/passwd");
    let users = read_text(&path)?;
    let numbers = |user: &str| {
        let line = users
            .lines()
            .find(|line| line.split(':').next() == Some(user))?;
        let mut fields = line.split(':').skip(2);
        Some((fields.next()?.parse().ok()?, fields.next()?.parse().ok()?))
    };
    numbers(DEFAULT)
        .or_else(|| numbers(&card.user))
        .ok_or_else(|| {
            let help = "begin with a stock Raspberry Pi OS Lite card";
            BadInput::without_excerpt(&path, "the user has no number", help)
        })
}

/// Whether a file of users or groups has one of this name.
fn has_user(file: &str, user: &str) -> bool {
    file.lines()
        .any(|line| line.split(':').next() == Some(user))
}

/// A file of users or groups, with the default user's name replaced. In `shadow` its password, too, by one that none fits.
fn renamed(text: &str, file: &str, user: &str) -> String {
    let is_groups = file.ends_with("group") || file.ends_with("gshadow");
    let lines = text.lines().map(|line| {
        let mut fields: Vec<_> = line.split(':').map(str::to_owned).collect();
        let is_default = fields[0] == DEFAULT;
        if is_default {
            user.clone_into(&mut fields[0]);
        }
        if is_default && file.ends_with("etc/shadow") && fields.len() > 1 {
            "*".clone_into(&mut fields[1]);
        }
        if is_default && file.ends_with("passwd") && fields.len() > 5 {
            fields[5] = format!("/home/{user}");
        }
        if let Some(members) = fields.last_mut().filter(|_| is_groups) {
            let names = members
                .split(',')
                .map(|it| if it == DEFAULT { user } else { it });
            *members = names.collect::<Vec<_>>().join(",");
        }
        format!("{}\n", fields.join(":"))
    });
    lines.collect()
}

//! The rules of an audit, and what keeps them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::Finding;
use super::facts::{Facts, Updates};
use super::fix::Change;

/// Settings of sshd. Debian reads this folder before its own settings, and the first setting counts.
const SSHD: &str = "/etc/ssh/sshd_config.d/00-muster.conf";
const BANNER: &str = "/etc/muster-banner";
const FIREWALL: &str = "/etc/muster-firewall.nft";
pub(super) const FIREWALL_UNIT: &str = "muster-firewall.service";
const SERIAL: &str = "/etc/udev/rules.d/60-muster-serial.rules";
/// Settings of apt. Names that come later count, and Debian's own begins with 20.
const UPDATES: &str = "/etc/apt/apt.conf.d/60muster-updates";
/// The highest exposure of a drone's service, in tenths.
const EXPOSURE_MAX: u32 = 20;

/// What breaks a rule.
pub(super) fn judge(facts: &Facts) -> Vec<Finding> {
    let mut findings = ssh(facts);
    findings.extend(passwords(facts));
    findings.extend(firewall(facts));
    findings.extend(files(facts));
    findings.extend(facts.updates.and_then(updates));
    findings.extend(facts.card.judge());
    findings
}

pub(super) fn finding(
    rule: &str,
    what: impl Into<String>,
    why: &str,
    undo: impl Into<String>,
) -> Finding {
    Finding {
        rule: rule.to_owned(),
        what: what.into(),
        why: why.to_owned(),
        undo: undo.into(),
        can_be_fixed: true,
    }
}

fn ssh(facts: &Facts) -> Vec<Finding> {
    let is = |name: &str, values: &[&str]| {
        let value = facts.sshd.get(name).map_or("", String::as_str);
        values.iter().any(|it| value.eq_ignore_ascii_case(it))
    };
    let undo = || format!("remove the line from {SSHD} and reload ssh");
    let mut findings = Vec::new();
    let passwords = ["passwordauthentication", "kbdinteractiveauthentication"];
    if !passwords.iter().all(|it| is(it, &["no"])) {
        let why = "passwords are guessed; keys are not";
        findings.push(finding(
            "ssh-keys-only",
            "sshd accepts passwords",
            why,
            undo(),
        ));
    }
    if !is("permitrootlogin", &["no"]) {
        let why = "root is a known user name; the log does not show who used it";
        let mut found = finding("ssh-no-root", "root can log in", why, undo());
        if facts.operator == "root" {
            "root can log in, and you do: log in as a user with sudo first"
                .clone_into(&mut found.what);
            found.can_be_fixed = false;
        }
        findings.push(found);
    }
    if is("banner", &["none", ""]) {
        let why = "a banner must state that the host is private";
        findings.push(finding(
            "ssh-banner",
            "no banner before the login",
            why,
            undo(),
        ));
    }
    if !is(
        "loglevel",
        &["VERBOSE", "DEBUG", "DEBUG1", "DEBUG2", "DEBUG3"],
    ) {
        let why = "the log shows which key was used";
        findings.push(finding(
            "ssh-log",
            "logins are logged without their key",
            why,
            undo(),
        ));
    }
    findings
}

fn passwords(facts: &Facts) -> Vec<Finding> {
    let users = facts.with_password.iter().map(|user| {
        let what = format!("the user {user} has a password");
        let why = "it opens the console, and sudo where that asks for one";
        finding("no-passwords", what, why, format!("passwd --unlock {user}"))
    });
    users.collect()
}

fn firewall(facts: &Facts) -> Option<Finding> {
    let is_there = facts.has_firewall && facts.firewall_starts;
    (!is_there).then(|| {
        let why = "without a firewall, any service left open by mistake can be reached by everyone in radio range";
        let undo = format!("systemctl disable --now {FIREWALL_UNIT}");
        finding(
            "firewall",
            "no firewall, another one, or not at boot",
            why,
            undo,
        )
    })
}

fn updates(state: Updates) -> Option<Finding> {
    let why = "what is known to be open stays open";
    let finding = |what: &str, undo: &str| finding("security-updates", what, why, undo);
    match state {
        Updates::On => None,
        Updates::Off => {
            let what = "security updates do not install themselves";
            Some(finding(what, &format!("remove {UPDATES}")))
        }
        Updates::Missing => {
            let what = "the package unattended-upgrades is not installed: install it first";
            let mut found = finding(what, "-");
            // A host in the field reaches no package server.
            found.can_be_fixed = false;
            Some(found)
        }
    }
}

fn files(facts: &Facts) -> Vec<Finding> {
    let mut findings = Vec::new();
    for path in &facts.open_keys {
        let what = format!("others can use {}", path.display());
        let why = "a drone's key lets its reader act as that drone";
        findings.push(finding("key-permissions", what, why, "chmod it back"));
    }
    for path in &facts.open_ports {
        let what = format!("everyone can use {}", path.display());
        let why = "writing to the flight controller's port flies the aircraft";
        findings.push(finding(
            "serial-permissions",
            what,
            why,
            format!("remove {SERIAL}"),
        ));
    }
    for (unit, exposure) in facts.exposures.iter().filter(|(_, it)| **it > EXPOSURE_MAX) {
        let (whole, tenth) = (exposure / 10, exposure % 10);
        let what = format!("{unit} has the exposure {whole}.{tenth}, above 2.0");
        let why = "a fault in musterd reaches no further than its sandbox";
        let mut found = finding("unit-sandbox", what, why, "-");
        // The unit comes with the release.
        found.can_be_fixed = false;
        findings.push(found);
    }
    findings
}

/// What keeps the rules that are broken.
pub(super) fn changes(facts: &Facts, findings: &[Finding]) -> Vec<Change> {
    let is_broken = |rule: &str| findings.iter().any(|it| it.rule == rule && it.can_be_fixed);
    let mut changes = Vec::new();
    let ssh_rules = ["ssh-keys-only", "ssh-no-root", "ssh-banner", "ssh-log"];
    if ssh_rules.iter().any(|it| is_broken(it)) {
        changes.push(write(BANNER, BANNER_TEXT.to_owned()));
        changes.push(write(SSHD, sshd_settings(facts)));
        changes.push(run(&["systemctl", "reload-or-restart", "ssh"]));
    }
    if is_broken("firewall") {
        changes.push(write(FIREWALL, firewall_rules(&facts.ssh_ports)));
        changes.push(write(
            &format!("/etc/systemd/system/{FIREWALL_UNIT}"),
            FIREWALL_TEXT.to_owned(),
        ));
        changes.push(run(&["systemctl", "daemon-reload"]));
        changes.push(Change::Run {
            words: words(&["systemctl", "enable", FIREWALL_UNIT]),
            undo: words(&["systemctl", "disable", "--now", FIREWALL_UNIT]),
        });
        // The unit is active also after something else has flushed its rules.
        changes.push(Change::Run {
            words: words(&["systemctl", "restart", FIREWALL_UNIT]),
            undo: words(&["systemctl", "daemon-reload"]),
        });
    }
    if is_broken("no-passwords") {
        for user in &facts.with_password {
            changes.push(Change::Run {
                words: words(&["passwd", "--lock", user]),
                undo: words(&["passwd", "--unlock", user]),
            });
        }
    }
    for path in facts
        .open_keys
        .iter()
        .filter(|_| is_broken("key-permissions"))
    {
        changes.push(Change::Close { path: path.clone() });
    }
    if is_broken("security-updates") {
        changes.push(write(UPDATES, UPDATES_TEXT.to_owned()));
    }
    if is_broken("serial-permissions") {
        changes.push(write(SERIAL, SERIAL_TEXT.to_owned()));
        for path in &facts.open_ports {
            changes.push(Change::Close { path: path.clone() });
        }
    }
    changes
}

fn write(path: &str, text: String) -> Change {
    Change::Write {
        path: PathBuf::from(path),
        text,
    }
}

/// A command that is run after a change, and again after it was undone.
fn run(of: &[&str]) -> Change {
    Change::Run {
        words: words(of),
        undo: words(of),
    }
}

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|it| (*it).to_owned()).collect()
}

fn sshd_settings(facts: &Facts) -> String {
    let root = if facts.operator == "root" {
        "prohibit-password"
    } else {
        "no"
    };
    format!(
        "# Written by muster deploy audit --fix.\nPasswordAuthentication no\nKbdInteractiveAuthentication no\n\
         PermitEmptyPasswords no\nPermitRootLogin {root}\nBanner {}\nLogLevel VERBOSE\n",
        Path::new(BANNER).display()
    )
}

const BANNER_TEXT: &str =
    "This computer flies an aircraft. Only its operators may log in; connections are logged.\n";

/// Lets in ssh, ICMP (1, 58), IGMP (2), and the drones' datagrams: the system chooses their ports. Protocols are numbers: not
/// every host has their names.
fn firewall_rules(ssh_ports: &BTreeSet<u16>) -> String {
    let ports: Vec<_> = ssh_ports.iter().map(u16::to_string).collect();
    let ports = if ports.is_empty() {
        "22".to_owned()
    } else {
        ports.join(", ")
    };
    format!(
        "# Written by muster deploy audit --fix.\ntable inet muster\ndelete table inet muster\ntable inet muster {{\n    \
         chain input {{\n        type filter hook input priority filter; policy drop;\n        \
         ct state established,related accept\n        iif lo accept\n        meta l4proto {{ 1, 2, 58 }} accept\n        \
         tcp dport {{ {ports} }} accept\n        udp dport {{ 68, 546, 1024-65535 }} accept\n    }}\n}}\n"
    )
}

/// Whether `nft -n list table inet muster` shows exactly the rules that are set.
pub(super) fn is_firewall(listed: &str, ssh_ports: &BTreeSet<u16>) -> bool {
    rules_of(listed) == rules_of(&firewall_rules(ssh_ports))
}

/// The rules of a table, without the ways in which nft prints them differently.
fn rules_of(table: &str) -> Vec<String> {
    let lines = table.lines().map(str::trim);
    let is_frame = |line: &str| ["", "}"].contains(&line) || line.starts_with('#');
    let is_table = |line: &str| line.starts_with("table ") || line.starts_with("delete table ");
    let rules = lines.filter(|line| !is_frame(line) && !is_table(line));
    let rules = rules.map(|line| {
        let line = line
            .replace('"', "")
            .replace("0x2,0x4", "established,related");
        let line = line.replace("priority 0;", "priority filter;");
        match line
            .split_once("{ ")
            .and_then(|(before, rest)| Some((before, rest.split_once(" }")?)))
        {
            Some((before, (only, after))) if !only.contains(',') => {
                format!("{before}{only}{after}")
            }
            _ => line,
        }
    });
    rules.collect()
}

const FIREWALL_TEXT: &str = "[Unit]
Description=Firewall of a muster host
DefaultDependencies=no
After=nftables.service
Before=network-pre.target shutdown.target
Wants=network-pre.target
Conflicts=shutdown.target

[Service]
Type=oneshot
RemainAfterExit=yes
ExecStart=/usr/sbin/nft -f /etc/muster-firewall.nft
ExecStop=-/usr/sbin/nft delete table inet muster

[Install]
WantedBy=multi-user.target
";

/// Once a day. What is installed restarts no computer that may fly.
const UPDATES_TEXT: &str = "// Written by muster deploy audit --fix.
APT::Periodic::Enable \"1\";
APT::Periodic::Update-Package-Lists \"1\";
APT::Periodic::Unattended-Upgrade \"1\";
Unattended-Upgrade::Automatic-Reboot \"false\";
";

const SERIAL_TEXT: &str = "# Written by muster deploy audit --fix.
SUBSYSTEM==\"tty\", KERNEL==\"ttyACM*|ttyAMA*|ttyUSB*\", GROUP=\"dialout\", MODE=\"0660\"
";

#[cfg(test)]
mod tests;

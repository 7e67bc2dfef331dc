//! Whether what `muster deploy image` set on this host's card still holds: without it the radio makes no ad hoc network, or a slow
//! one, and the serial port is not free.

use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Finding;
use super::facts::output;
use super::rules::finding;

/// Path of a card's record, from the root.
pub const RECORD: &str = "etc/muster-card.json";
/// Path of the script that sets the radio's rate, from the root.
pub const RADIO: &str = "etc/NetworkManager/dispatcher.d/50-muster";
/// The user of a stock card.
pub const DEFAULT_USER: &str = "pi";
/// What sets the radio's rate, but for the rate in Mbit/s.
pub const SET_RATE: &str = "iw dev wlan0 set bitrates legacy-2.4";

/// Services that set the clock.
const TIME_SERVICES: [&str; 3] = [
    "systemd-timesyncd.service",
    "chrony.service",
    "ntpsec.service",
];

/// What a card was made for, as it says itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CardRecord {
    /// Name of the ad hoc network.
    pub ssid: String,
    /// Its channel at 2.4 GHz.
    pub channel: u8,
    /// Its fixed rate, in Mbit/s.
    pub rate_mbps: u8,
    /// Country code of the radio regulations: two letters.
    pub country: String,
}

/// The state of a host whose card was prepared.
#[derive(Debug, Clone)]
pub(super) struct Card {
    pub(super) record: CardRecord,
    /// What `iw dev wlan0 info` prints.
    pub(super) radio: String,
    /// What `iw dev wlan0 get power_save` prints.
    pub(super) power_save: String,
    /// What `iw reg get` prints.
    pub(super) country: String,
    /// The script that sets the rate; empty if it is not there or can't be run.
    pub(super) rate: String,
    /// The kernel's arguments.
    pub(super) kernel: String,
    /// Whether the default user is there.
    pub(super) has_default_user: bool,
    /// Whether a service sets the clock.
    pub(super) keeps_time: bool,
}

/// What is known of a host's card.
#[derive(Debug, Clone, Default)]
pub(super) enum Prepared {
    /// The host is no Raspberry Pi.
    #[default]
    NotNeeded,
    /// A Raspberry Pi, and `muster deploy image` did not prepare its card.
    Not,
    Card(Box<Card>),
}

impl Prepared {
    /// Looks at the host whose root folder is given.
    pub(super) fn gather(root: &Path, passwd: &str) -> io::Result<Self> {
        let record = match fs::read(root.join(RECORD)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let model = root.join("proc/device-tree/model");
                let is_pi =
                    fs::read_to_string(model).is_ok_and(|it| it.starts_with("Raspberry Pi"));
                return Ok(if is_pi { Self::Not } else { Self::NotNeeded });
            }
            text => serde_json::from_slice(&text?)?,
        };
        let ask = |words: &[&str]| output("iw", words).unwrap_or_default();
        let services = [&["is-active"], TIME_SERVICES.as_slice()].concat();
        let states = output("systemctl", &services)?;
        let script = root.join(RADIO);
        let can_run = fs::metadata(&script).is_ok_and(|it| it.permissions().mode() & 0o100 != 0);
        let rate = fs::read_to_string(script).unwrap_or_default();
        Ok(Self::Card(Box::new(Card {
            record,
            radio: ask(&["dev", "wlan0", "info"]),
            power_save: ask(&["dev", "wlan0", "get", "power_save"]),
            country: ask(&["reg", "get"]),
            rate: if can_run { rate } else { String::new() },
            kernel: fs::read_to_string(root.join("proc/cmdline"))?,
            has_default_user: passwd
                .lines()
                .any(|line| line.split(':').next() == Some(DEFAULT_USER)),
            keeps_time: states.lines().any(|it| it == "active"),
        })))
    }

    /// What of it does not hold.
    pub(super) fn judge(&self) -> Vec<Finding> {
        match self {
            Self::NotNeeded => Vec::new(),
            Self::Not => vec![broken(
                "card",
                "the card was not prepared",
                "stock cards join no ad hoc network, and their serial port is a console",
            )],
            Self::Card(card) => {
                let mut findings = card.radio();
                findings.extend(card.others());
                findings
            }
        }
    }
}

/// Nothing of it is set by a fix: it counts from the next boot on.
fn broken(rule: &str, what: &str, why: &str) -> Finding {
    let what = format!("{what}: run `muster deploy image` on its card");
    let mut found = finding(rule, what, why, "-");
    found.can_be_fixed = false;
    found
}

impl Card {
    fn radio(&self) -> Vec<Finding> {
        let CardRecord {
            ssid,
            channel,
            rate_mbps,
            country,
        } = &self.record;
        let says = |name: &str| {
            let mut lines = self.radio.lines().map(str::trim);
            let value = lines.find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
            value.unwrap_or("none").to_owned()
        };
        let mut findings = Vec::new();
        let number = says("channel");
        let number = number.split(' ').next().unwrap_or_default();
        let (kind, name) = (says("type"), says("ssid"));
        if (kind.as_str(), name.as_str()) != ("IBSS", ssid)
            || number.parse::<u8>().ok() != Some(*channel)
        {
            let what = format!(
                "wlan0 is {kind} in the network {name} on channel {number}, \
                 not IBSS in {ssid} on {channel}"
            );
            let why = "drones hear each other directly in one ad hoc network only";
            findings.push(broken("radio-network", &what, why));
        }
        if self.power_save.trim() != "Power save: off" {
            let why = "a radio that sleeps loses datagrams";
            findings.push(broken("radio-power-save", "wlan0 saves power", why));
        }
        let set = format!("{SET_RATE} {rate_mbps}");
        if !self.rate.lines().any(|line| line.trim() == set) {
            let what = format!("{RADIO} does not set the rate {rate_mbps} Mbit/s");
            let why = "a rate that changes by itself changes which drones hear each other";
            findings.push(broken("radio-rate", &what, why));
        }
        let begin = format!("country {country}:");
        if !self.country.lines().any(|line| line.starts_with(&begin)) {
            let what = format!("the radio's country is not {country}");
            let why = "power and channels are bound by law";
            findings.push(broken("radio-country", &what, why));
        }
        findings
    }

    fn others(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let consoles = ["console=serial", "console=ttyAMA", "console=ttyS"];
        let is_console = |word: &str| consoles.iter().any(|it| word.starts_with(it));
        if self.kernel.split_whitespace().any(is_console) {
            let why = "the kernel writes into what the flight controller reads";
            findings.push(broken(
                "serial-console",
                "a console is on the serial port",
                why,
            ));
        }
        if self.has_default_user {
            let what = format!("the default user {DEFAULT_USER} is there");
            findings.push(broken(
                "default-user",
                &what,
                "its name is what a stranger tries first",
            ));
        }
        if !self.keeps_time {
            let why =
                "grants expire, and logs are compared, by the clock; a Pi's stops without power";
            findings.push(broken("time-service", "no service sets the clock", why));
        }
        findings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prepared() -> Card {
        let record = CardRecord {
            ssid: "muster".to_owned(),
            channel: 6,
            rate_mbps: 12,
            country: "DE".to_owned(),
        };
        Card {
            record,
            radio: "Interface wlan0\n\tifindex 3\n\tssid muster\n\ttype IBSS\n\t\
                    channel 6 (2437 MHz), width: 20 MHz (no HT), center1: 2437 MHz\n"
                .to_owned(),
            power_save: "Power save: off\n".to_owned(),
            country: "global\ncountry DE: DFS-ETSI\n\t(2400 - 2483 @ 40), (N/A, 20), (N/A)\n"
                .to_owned(),
            rate: format!("#!/bin/sh\n{SET_RATE} 12\n"),
            kernel: "console=tty1 root=PARTUUID=1-02 rootwait\n".to_owned(),
            has_default_user: false,
            keeps_time: true,
        }
    }

    fn rules(card: Card) -> Vec<String> {
        let findings = Prepared::Card(Box::new(card)).judge();
        assert!(findings.iter().all(|it| !it.can_be_fixed));
        findings.into_iter().map(|it| it.rule).collect()
    }

    #[test]
    fn prepared_card_breaks_no_rule_and_each_weakness_breaks_one() {
        type Plant = fn(&mut Card);
        assert_eq!(rules(prepared()), [""; 0]);
        let table: [(&str, Plant); 11] = [
            ("radio-network", |it| it.radio.clear()),
            ("radio-network", |it| it.record.ssid.push('2')),
            ("radio-network", |it| it.record.channel = 11),
            ("radio-network", |it| {
                it.radio = it.radio.replace("IBSS", "managed");
            }),
            ("radio-power-save", |it| {
                it.power_save = "Power save: on\n".to_owned();
            }),
            ("radio-rate", |it| it.record.rate_mbps = 1),
            ("radio-rate", |it| it.rate.clear()),
            ("radio-country", |it| it.record.country = "FR".to_owned()),
            ("serial-console", |it| {
                it.kernel.insert_str(0, "console=serial0,115200 ");
            }),
            ("default-user", |it| it.has_default_user = true),
            ("time-service", |it| it.keeps_time = false),
        ];
        for (rule, plant) in table {
            let mut card = prepared();
            plant(&mut card);
            assert_eq!(rules(card), [rule]);
        }
    }

    #[test]
    fn pi_with_a_stock_card_is_found_and_another_computer_is_not() {
        let root = tempfile::tempdir().unwrap();
        let model = root.path().join("proc/device-tree/model");
        fs::create_dir_all(model.parent().unwrap()).unwrap();
        let rules = || {
            let found = Prepared::gather(root.path(), "").unwrap().judge();
            found.into_iter().map(|it| it.rule).collect::<Vec<_>>()
        };
        assert_eq!(rules(), [""; 0]);
        fs::write(model, "Raspberry Pi 4 Model B Rev 1.4\0").unwrap();
        assert_eq!(rules(), ["card"]);
    }

    #[test]
    fn record_that_cannot_be_read_is_an_error() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir(root.path().join("etc")).unwrap();
        fs::write(root.path().join(RECORD), "{}").unwrap();
        Prepared::gather(root.path(), "").unwrap_err();
    }
}

//! What the files of a card say.

use std::net::Ipv4Addr;

use muster_daemon::audit::{CardRecord, DEFAULT_USER, RADIO, RECORD, SET_RATE};

use super::Card;

/// Rates of a fixed-rate network, in Mbit/s: those of 802.11b and g that are whole numbers.
pub const RATES_MBPS: [u8; 11] = [1, 2, 6, 9, 11, 12, 18, 24, 36, 48, 54];

/// Begins and ends what is ours in `config.txt`.
const MARKS: [&str; 2] = ["# muster deploy image: begin", "# muster deploy image: end"];

/// Reads a user's name.
///
/// # Errors
/// What is accepted, in words.
pub fn user_name(text: &str) -> Result<String, String> {
    let is_fine = |it: u8| it.is_ascii_lowercase() || it.is_ascii_digit() || b"_-".contains(&it);
    let is_name = text.bytes().all(is_fine) && text.starts_with(|it: char| it.is_ascii_lowercase());
    if is_name && text.len() <= 32 && ![DEFAULT_USER, "root"].contains(&text) {
        return Ok(text.to_owned());
    }
    Err("a user's name has up to 32 lower-case letters, digits, _ and -, begins with a letter, and is neither pi nor root".to_owned())
}

/// Reads a host's name.
///
/// # Errors
/// What is accepted, in words.
pub fn host_name(text: &str) -> Result<String, String> {
    let is_fine = |it: u8| it.is_ascii_lowercase() || it.is_ascii_digit() || it == b'-';
    let has_ends = !text.starts_with('-') && !text.ends_with('-');
    if (1..=63).contains(&text.len()) && text.bytes().all(is_fine) && has_ends {
        return Ok(text.to_owned());
    }
    Err("a host's name has up to 63 lower-case letters, digits and -, not at its ends".to_owned())
}

/// Reads a host's address and the length of its network's prefix.
///
/// # Errors
/// What is accepted, in words.
pub fn address(text: &str) -> Result<(Ipv4Addr, u8), String> {
    let accepted =
        "an address of a host and a prefix of 8 to 30 bits are accepted, such as 10.0.0.10/24";
    let read = || {
        let (address, prefix) = text.split_once('/')?;
        let prefix = prefix.parse().ok().filter(|it| (8..=30).contains(it))?;
        Some((address.parse::<Ipv4Addr>().ok()?, prefix))
    };
    let (address, prefix) = read().ok_or_else(|| accepted.to_owned())?;
    let host = address.to_bits() & (u32::MAX >> prefix);
    let what = if address.is_multicast() {
        "is a multicast address"
    } else if address.is_loopback() {
        "is a loopback address"
    } else if address.octets()[0] == 0 || address.octets()[0] >= 240 {
        "is an address of no host"
    } else if host == 0 {
        "is the address of the network itself"
    } else if host == u32::MAX >> prefix {
        "is the network's broadcast address"
    } else {
        return Ok((address, prefix));
    };
    Err(format!("{address} {what}; {accepted}"))
}

/// Reads a network's name.
///
/// # Errors
/// What is accepted, in words.
pub fn ssid(text: &str) -> Result<String, String> {
    let is_fine = |it: u8| it.is_ascii_alphanumeric() || b"_-".contains(&it);
    if (1..=32).contains(&text.len()) && text.bytes().all(is_fine) {
        return Ok(text.to_owned());
    }
    Err("a network's name has up to 32 letters, digits, _ and -".to_owned())
}

/// Reads a country's code.
///
/// # Errors
/// What is accepted, in words.
pub fn country(text: &str) -> Result<String, String> {
    if text.len() == 2 && text.bytes().all(|it| it.is_ascii_uppercase()) {
        return Ok(text.to_owned());
    }
    Err("a country has two capital letters, such as DE (ISO 3166)".to_owned())
}

/// Why a file has no public keys. `None` if it has only those.
pub(super) fn is_no_public_key(text: &str) -> Option<&'static str> {
    if text.contains("PRIVATE KEY") {
        return Some("this is a secret key");
    }
    let is_key = |line: &str| {
        let mut words = line.split_whitespace();
        let kind = words.next().unwrap_or_default();
        let kinds = ["ssh-", "ecdsa-sha2-", "sk-ssh-", "sk-ecdsa-"];
        kinds.iter().any(|it| kind.starts_with(it)) && words.next().is_some_and(|it| it.len() >= 32)
    };
    let mut lines = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .peekable();
    let has_none = lines.peek().is_none();
    (has_none || !lines.all(is_key)).then_some("this has lines that are no public keys of ssh")
}

/// Why what is ours in `config.txt` can't be replaced: lines after it would be lost. `None` if it can.
pub(super) fn is_no_config(text: &str) -> Option<&'static str> {
    let [begin, end] = MARKS;
    let mut is_ours = false;
    for line in text.lines() {
        if line == begin && is_ours || line == end && !is_ours {
            return Some("has a mark of `muster deploy image` without the other one");
        }
        is_ours = line == begin || is_ours && line != end;
    }
    is_ours.then_some("has a mark of `muster deploy image` without the other one")
}

/// The kernel's arguments: no console on the serial port, and the country of the radio.
pub(super) fn cmdline(text: &str, card: &Card) -> String {
    let is_ours = |word: &&str| {
        let consoles = ["console=serial", "console=ttyAMA", "console=ttyS"];
        !consoles.iter().any(|it| word.starts_with(it))
            && !word.starts_with("cfg80211.ieee80211_regdom=")
    };
    let words: Vec<_> = text.split_whitespace().filter(is_ours).collect();
    format!(
        "{} cfg80211.ieee80211_regdom={}\n",
        words.join(" "),
        card.country
    )
}

/// The firmware's settings: the serial port at the pins, with the better of both controllers, which Bluetooth has otherwise.
pub(super) fn config(text: &str, _card: &Card) -> String {
    let [begin, end] = MARKS;
    let mut is_ours = false;
    let mut kept = String::new();
    for line in text.lines() {
        is_ours |= line == begin;
        if !is_ours {
            kept.push_str(line);
            kept.push('\n');
        }
        is_ours &= line != end;
    }
    format!("{kept}{begin}\n[all]\nenable_uart=1\ndtoverlay=disable-bt\n{end}\n")
}

/// The host's own name, beside what was there.
pub(super) fn hosts(text: &str, card: &Card) -> String {
    let others = text.lines().filter(|line| !line.starts_with("127.0.1.1"));
    let others: String = others.map(|line| format!("{line}\n")).collect();
    format!("{others}127.0.1.1\t{}\n", card.name)
}

/// Files below the root, with their permissions.
pub(super) fn files(card: &Card) -> [(&'static str, u32, String); 6] {
    let Card {
        name,
        ssid,
        channel,
        rate_mbps,
        country,
        ..
    } = card;
    let (address, prefix) = card.address;
    let network = format!(
        "[connection]\nid=muster\ntype=wifi\ninterface-name=wlan0\nautoconnect=true\n\n[wifi]\nmode=adhoc\nband=bg\n\
         channel={channel}\nssid={ssid}\npowersave=2\n\n[ipv4]\nmethod=manual\naddress1={address}/{prefix}\n\n\
         [ipv6]\nmethod=link-local\n"
    );
    let radio = format!(
        "#!/bin/sh\n# A fixed rate, and no sleep: what is sent at a low rate by itself arrives where links are weak.\n\
         [ \"$1 $2\" = \"wlan0 up\" ] || exit 0\niw dev wlan0 set power_save off\n\
         {SET_RATE} {rate_mbps}\n"
    );
    let unblock = "[Unit]\nDescription=Radio of a muster host\nBefore=NetworkManager.service\n\n[Service]\nType=oneshot\n\
                   ExecStart=/usr/sbin/rfkill unblock wifi\n\n[Install]\nWantedBy=multi-user.target\n";
    let servers = card
        .time_server
        .map_or_else(String::new, |it| format!("NTP={it}\n"));
    let record = CardRecord {
        ssid: ssid.clone(),
        channel: *channel,
        rate_mbps: *rate_mbps,
        country: country.clone(),
    };
    let record = serde_json::to_string(&record).expect("a card's record is texts and numbers");
    [
        ("etc/hostname", 0o644, format!("{name}\n")),
        (
            "etc/NetworkManager/system-connections/muster.nmconnection",
            0o600,
            network,
        ),
        (RADIO, 0o755, radio),
        (
            "etc/systemd/system/muster-radio.service",
            0o644,
            unblock.to_owned(),
        ),
        (
            "etc/systemd/timesyncd.conf.d/muster.conf",
            0o644,
            format!("[Time]\n{servers}"),
        ),
        (RECORD, 0o644, format!("{record}\n")),
    ]
}

use std::net::Ipv4Addr;
use std::path::PathBuf;

use clap::Args;
use muster_deploy::image::{
    Card, RATES_MBPS, address, country, host_name, prepare, ssid, user_name,
};

use crate::command::{Failure, Outcome, numbers, terminal};

/// Prepare a stock Raspberry Pi OS Lite card, so that it starts without a screen and is reached over ssh.
///
/// Write the image to a card, mount its two partitions, and name their folders. The default user becomes yours, without a
/// password; your public keys let you in. The radio is in an ad hoc network with a fixed channel and rate and without power
/// saving. The serial port at the pins is free for a flight controller. Nothing is changed if something can't be.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder of the card's boot partition.
    #[arg(long, value_name = "DIR")]
    boot: PathBuf,
    /// Folder of the card's root partition.
    #[arg(long, value_name = "DIR")]
    root: PathBuf,
    /// Name of the host.
    #[arg(long, value_parser = host_name)]
    name: String,
    /// The user who logs in.
    #[arg(long, value_parser = user_name)]
    user: String,
    /// File with the public keys of who may log in.
    #[arg(long, value_name = "FILE")]
    authorized_keys: PathBuf,
    /// Address in the drones' network, such as 10.0.0.10/24.
    #[arg(long, value_name = "ADDRESS/N", value_parser = address)]
    address: (Ipv4Addr, u8),
    /// Name of the ad hoc network.
    #[arg(long, default_value = "muster", value_parser = ssid)]
    ssid: String,
    /// Its channel at 2.4 GHz.
    #[arg(long, value_name = "1..13", default_value_t = 1, value_parser = numbers::whole::<u8>(1..=13), allow_negative_numbers = true)]
    channel: u8,
    /// Its fixed rate, in Mbit/s.
    #[arg(long, value_name = "RATE", default_value_t = 6, value_parser = rate)]
    rate_mbps: u8,
    /// Country code of the radio regulations, such as DE.
    #[arg(long, value_name = "CODE", value_parser = country)]
    country: String,
    /// Address of a time server in the drones' network
    #[arg(long, value_name = "ADDRESS")]
    time_server: Option<Ipv4Addr>,
}

fn rate(text: &str) -> Result<u8, String> {
    let rate = text.parse().ok().filter(|it| RATES_MBPS.contains(it));
    rate.ok_or_else(|| format!("one of {RATES_MBPS:?}"))
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let card = Card {
        name: arguments.name.clone(),
        user: arguments.user.clone(),
        authorized_keys: arguments.authorized_keys.clone(),
        address: arguments.address,
        ssid: arguments.ssid.clone(),
        channel: arguments.channel,
        rate_mbps: arguments.rate_mbps,
        country: arguments.country.clone(),
        time_server: arguments.time_server,
    };
    let changed = prepare(&arguments.boot, &arguments.root, &card)?;
    let Card {
        name,
        user,
        address,
        ..
    } = &card;
    terminal::print(&format!(
        " set {} files of {name}; after its first boot: ssh {user}@{}\n",
        changed.len(),
        address.0
    ))?;
    Ok(Outcome::Success)
}

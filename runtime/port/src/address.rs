//! Names of ports.

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

/// Speed of a serial device that names none, in Bd: Betaflight's default for MSP.
const BAUD: u32 = 115_200;

/// Where a flight controller is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A serial device.
    Serial {
        /// The device's file.
        path: PathBuf,
        /// Speed, in Bd; USB devices ignore it.
        baud: u32,
    },
    /// A simulation.
    Tcp {
        /// Host and port.
        host: String,
    },
}

/// A name that is no port's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{found}` is no flight controller's port; `serial:/dev/ttyACM0`, `serial:/dev/ttyAMA0@115200` and `tcp:127.0.0.1:5761` \
     are examples"
)]
pub struct BadAddress {
    /// The name given.
    pub found: String,
}

impl Address {
    /// Whether it is a loopback address or a device of this host.
    #[must_use]
    pub fn is_on_this_host(&self) -> bool {
        let Self::Tcp { host } = self else {
            return true;
        };
        let address = host.parse::<SocketAddr>();
        address.map_or_else(
            |_| host.starts_with("localhost:"),
            |it| it.ip().is_loopback(),
        )
    }
}

impl FromStr for Address {
    type Err = BadAddress;

    fn from_str(name: &str) -> Result<Self, BadAddress> {
        let bad = || BadAddress {
            found: name.to_owned(),
        };
        if let Some(host) = name.strip_prefix("tcp:") {
            let (name, port) = host.rsplit_once(':').ok_or_else(bad)?;
            port.parse::<u16>()
                .ok()
                .filter(|it| *it > 0)
                .ok_or_else(bad)?;
            return (!name.is_empty())
                .then(|| Self::Tcp {
                    host: host.to_owned(),
                })
                .ok_or_else(bad);
        }
        // A device's name alone will do.
        let device = match name.strip_prefix("serial:") {
            Some(device) => device,
            None if name.starts_with('/') => name,
            None => return Err(bad()),
        };
        let (path, baud) = match device.rsplit_once('@') {
            Some((path, baud)) => (path, baud.parse().map_err(|_| bad())?),
            None => (device, BAUD),
        };
        if path.is_empty() || baud == 0 {
            return Err(bad());
        }
        Ok(Self::Serial {
            path: path.into(),
            baud,
        })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { path, baud } => write!(f, "serial:{}@{baud}", path.display()),
            Self::Tcp { host } => write!(f, "tcp:{host}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_written_alike() {
        for (name, written) in [
            ("serial:/dev/ttyACM0", "serial:/dev/ttyACM0@115200"),
            ("/dev/ttyACM0", "serial:/dev/ttyACM0@115200"),
            ("serial:/dev/ttyAMA0@500000", "serial:/dev/ttyAMA0@500000"),
            ("tcp:127.0.0.1:5761", "tcp:127.0.0.1:5761"),
            ("tcp:[::1]:5761", "tcp:[::1]:5761"),
        ] {
            let address: Address = name.parse().expect("a port");
            assert_eq!(address.to_string(), written);
            assert_eq!(written.parse(), Ok(address));
        }
    }

    #[test]
    fn other_names_are_refused() {
        for name in [
            "",
            "ttyACM0",
            "serial:",
            "serial:@115200",
            "serial:/dev/x@0",
            "serial:/dev/x@fast",
            "tcp:localhost",
            "tcp::5761",
            "tcp:localhost:0",
            "udp:localhost:1",
        ] {
            assert!(name.parse::<Address>().is_err(), "{name}");
        }
    }
}

//! The name of a port.

use std::net::SocketAddr;
use std::str::FromStr;

use thiserror::Error;

/// Where an autopilot's datagrams arrive: `udpin:ADDRESS:PORT`, as in pymavlink.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address(SocketAddr);

/// A name that is none of a port.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "\"{0}\" is no port of an autopilot: it needs \"udpin:ADDRESS:PORT\", for example \"udpin:127.0.0.1:14550\""
)]
pub struct AddressError(String);

impl Address {
    /// The address to listen at.
    #[must_use]
    pub const fn socket(self) -> SocketAddr {
        self.0
    }

    /// Whether datagrams can come from this machine only.
    #[must_use]
    pub fn is_loopback(self) -> bool {
        self.0.ip().is_loopback()
    }
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(name: &str) -> Result<Self, AddressError> {
        let socket = name.strip_prefix("udpin:").and_then(|it| it.parse().ok());
        socket
            .filter(|it: &SocketAddr| it.port() > 0)
            .map(Self)
            .ok_or_else(|| AddressError(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_pymavlink() {
        let address: Address = "udpin:127.0.0.1:14550".parse().unwrap();
        assert!(address.is_loopback() && address.socket().port() == 14550);
        let any: Address = "udpin:0.0.0.0:14550".parse().unwrap();
        assert!(!any.is_loopback());
        for bad in [
            "udpin:127.0.0.1:0",
            "udpin:localhost",
            "tcp:127.0.0.1:5760",
            "",
            "udpin:",
        ] {
            assert_eq!(bad.parse::<Address>(), Err(AddressError(bad.to_owned())));
        }
    }
}

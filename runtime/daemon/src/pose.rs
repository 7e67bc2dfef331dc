//! Poses that a program on the same machine measures: motion capture, beacons, a localisation.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use muster_machines::geometry::Ned;
use muster_machines::msp::{PortEvent, Pose};
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc::Sender;

/// Longest message, in bytes; a longer one is ignored.
const MESSAGE_MAX: usize = 512;
/// Largest coordinate of a pose, in metres: no drone flies that far from its home.
const PLACE_MAX_M: f64 = 100_000.0;
/// How long the thread waits before it looks whether the process has ended.
const WAIT: Duration = Duration::from_millis(200);

/// A pose as a UDP datagram: one JSON object, such as
/// `{"north_m": 1.2, "east_m": 0.3, "down_m": -2.0, "sigma_m": 0.05, "age_ms": 100}`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Message {
    /// North of home, in metres.
    pub north_m: f64,
    /// East of home, in metres.
    pub east_m: f64,
    /// Below home, in metres.
    pub down_m: f64,
    /// Standard deviation on each axis, in metres; from 0.001 to 1.
    pub sigma_m: f64,
    /// Time since it was measured, in milliseconds; at most 500.
    pub age_ms: f64,
}

impl From<Pose> for Message {
    fn from(pose: Pose) -> Self {
        Self {
            north_m: pose.position.north_m(),
            east_m: pose.position.east_m(),
            down_m: -pose.position.altitude_m(),
            sigma_m: pose.sigma_m,
            age_ms: pose.age.as_secs_f64() * 1_000.0,
        }
    }
}

impl Message {
    /// The datagram.
    ///
    /// # Panics
    /// Never: numbers are written whatever they are.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).expect("numbers can be written")
    }

    /// Reads a datagram. `None` if it is no pose that a link would take in.
    #[must_use]
    pub fn read(datagram: &[u8]) -> Option<Pose> {
        let message: Self = serde_json::from_slice(datagram).ok()?;
        let age_s = message.age_ms / 1_000.0;
        let place_m = [message.north_m, message.east_m, message.down_m];
        let is_far = place_m.iter().any(|it| it.abs() > PLACE_MAX_M);
        if is_far || !Pose::SIGMA_M.contains(&message.sigma_m) {
            return None;
        }
        Some(Pose {
            position: Ned::from(place_m),
            sigma_m: message.sigma_m,
            age: Duration::try_from_secs_f64(age_s).ok()?,
        })
    }
}

/// Passes the poses that arrive at an address of this machine on, until nobody takes them any more. Others are counted and
/// logged, at most once each power of two.
///
/// # Errors
/// If the address can't be bound.
pub(crate) fn listen(address: SocketAddr, poses: Sender<PortEvent>) -> io::Result<()> {
    let socket = UdpSocket::bind(address)?;
    socket.set_read_timeout(Some(WAIT))?;
    let thread = std::thread::Builder::new().name("poses".to_owned());
    thread.spawn(move || {
        let mut bad = 0_u64;
        let mut datagram = [0; MESSAGE_MAX + 1];
        while !poses.is_closed() {
            let Ok(length) = socket.recv(&mut datagram) else {
                continue;
            };
            match Message::read(&datagram[..length]) {
                // While the link is behind, a pose is dropped: the next one is newer.
                Some(pose) => drop(poses.try_send(PortEvent::Pose(pose))),
                None => {
                    bad += 1;
                    if bad.is_power_of_two() {
                        tracing::warn!(bad, "ignored a datagram that is no pose");
                    }
                }
            }
        }
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_pose_is_read_back() {
        let pose = Pose {
            position: Ned::new(1.25, -0.5, -2.0),
            sigma_m: 0.05,
            age: Duration::from_millis(100),
        };
        assert_eq!(Message::read(&Message::from(pose).to_bytes()), Some(pose));
    }

    #[test]
    fn what_is_no_pose_is_refused() {
        let bad: [&[u8]; 8] = [
            b"",
            b"{}",
            br#"{"north_m":1,"east_m":2,"down_m":3,"sigma_m":0.1,"age_ms":-1}"#,
            br#"{"north_m":1,"east_m":2,"down_m":3,"sigma_m":0.1,"age_ms":1e300}"#,
            br#"{"north_m":1,"east_m":-2e5,"down_m":3,"sigma_m":0.1,"age_ms":1}"#,
            br#"{"north_m":1,"east_m":2,"down_m":3,"sigma_m":0,"age_ms":1}"#,
            br#"{"north_m":1,"east_m":2,"down_m":3,"sigma_m":500,"age_ms":1}"#,
            br#"{"north_m":1,"east_m":2,"down_m":3,"sigma_m":1.8e308,"age_ms":1}"#,
        ];
        for datagram in bad {
            assert_eq!(Message::read(datagram), None);
        }
    }
}

//! A simulated broadcast medium: radios at places, a range, a latency, a loss.

mod grid;

use std::collections::VecDeque;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use self::grid::Grid;
use crate::{Arrival, SendError, Transport};

/// What a medium is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// How far a radio reaches, in metres; beyond it nothing is heard, within it all but what is lost.
    pub range_m: f64,
    /// The share of frames that each receiver misses, drawn for each frame and receiver; 0 to 1.
    pub loss: f64,
    /// How long a frame takes at least.
    pub latency: Duration,
    /// How much longer it may take, drawn for each frame and receiver.
    pub jitter: Duration,
    /// The largest datagram, in bytes.
    pub datagram_max: usize,
}

/// A broadcast medium that carries datagrams between places.
///
/// A broadcast costs as much as the radios in range, whatever the size of the swarm: they are looked up in a grid of
/// cells as wide as the range. Lots are drawn from the medium's own generator, for the receivers in rising order.
#[derive(Debug)]
pub struct Medium {
    config: Config,
    rng: ChaCha8Rng,
    grid: Grid,
    arrivals: VecDeque<Arrival>,
    in_range: Vec<NodeId>,
}

impl Medium {
    /// A medium with a radio at each of `places`, drone 0's first.
    #[must_use]
    pub fn new(config: Config, rng: ChaCha8Rng, places: &[Ned]) -> Self {
        Self {
            grid: Grid::new(config.range_m, places),
            arrivals: VecDeque::new(),
            in_range: Vec::new(),
            config,
            rng,
        }
    }

    /// Puts a drone's radio elsewhere.
    ///
    /// # Panics
    /// When the medium was built without that drone.
    pub fn place(&mut self, id: NodeId, place: Ned) {
        self.grid.place(id, place);
    }

    fn is_lost(&mut self) -> bool {
        self.config.loss > 0.0 && self.rng.random::<f64>() < self.config.loss
    }

    fn travel_time(&mut self) -> Duration {
        let jitter = u64::try_from(self.config.jitter.as_nanos()).unwrap_or(u64::MAX);
        let extra = if jitter > 0 {
            self.rng.next_u64() % jitter
        } else {
            0
        };
        self.config.latency + Duration::from_nanos(extra)
    }
}

impl Transport for Medium {
    fn datagram_max(&self) -> usize {
        self.config.datagram_max
    }

    fn broadcast(
        &mut self,
        now: Timestamp,
        from: NodeId,
        datagram: &Bytes,
    ) -> Result<(), SendError> {
        if datagram.len() > self.config.datagram_max {
            return Err(SendError::TooLong {
                len: datagram.len(),
                max: self.config.datagram_max,
            });
        }
        let mut in_range = std::mem::take(&mut self.in_range);
        self.grid.in_range(from, &mut in_range)?;
        for to in in_range.drain(..) {
            if !self.is_lost() {
                let at = now + self.travel_time();
                self.arrivals.push_back(Arrival {
                    at,
                    to,
                    datagram: datagram.clone(),
                });
            }
        }
        self.in_range = in_range;
        Ok(())
    }

    fn poll_arrival(&mut self) -> Option<Arrival> {
        self.arrivals.pop_front()
    }
}

#[cfg(test)]
mod tests;

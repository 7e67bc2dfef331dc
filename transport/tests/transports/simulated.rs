//! The simulated media.

use std::num::NonZeroUsize;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::geometry::Ned;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use muster_transport::sim::{Access, Config, Medium, Propagation};
use muster_transport::{Arrival, Destination, Event, Outcome, SendError, Transport};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::suite::{DATAGRAM_MAX, Network, contract_tests};

struct Simulated {
    medium: Medium,
    now: Timestamp,
    outcomes: Vec<Outcome>,
}

impl Simulated {
    fn new(access: Access) -> Self {
        let config = Config {
            propagation: Propagation::Range { range_m: 100.0 },
            loss: 0.0,
            bursts: None,
            access,
            datagram_max: DATAGRAM_MAX,
        };
        let positions = [0.0, 10.0, 20.0, 30.0].map(|east_m| Ned::new(0.0, east_m, 0.0));
        Self {
            medium: Medium::new(config, ChaCha8Rng::seed_from_u64(1), &positions),
            now: Timestamp::ZERO,
            outcomes: Vec::new(),
        }
    }
}

impl Network for Simulated {
    fn send(&mut self, from: NodeId, to: Destination, datagram: &Bytes) -> Result<(), SendError> {
        self.medium.send(self.now, from, to, datagram)
    }

    fn arrivals(&mut self) -> Vec<Arrival> {
        let mut arrivals = Vec::new();
        loop {
            while let Some(event) = self.medium.poll_event() {
                self.now = self.now.max(event.at());
                match event {
                    Event::Arrival(arrival) => arrivals.push(arrival),
                    Event::Outcome(outcome) => self.outcomes.push(outcome),
                }
            }
            let Some(next) = self.medium.next_timeout() else {
                return arrivals;
            };
            self.now = self.now.max(next);
            self.medium.handle_timeout(self.now);
        }
    }

    fn outcomes(&mut self) -> Vec<Outcome> {
        std::mem::take(&mut self.outcomes)
    }

    fn learn(&mut self, _drone: NodeId, arrival: &Arrival, _sender: NodeId) {
        assert_eq!(arrival.source, None, "a medium has no addresses");
    }
}

mod ideal {
    use super::*;

    contract_tests!(Simulated::new(Access::Ideal {
        latency: Duration::from_micros(231),
        jitter: Duration::from_millis(1),
    }));
}

mod csma {
    use super::*;

    contract_tests!(Simulated::new(Access::Csma {
        jitter: Duration::from_millis(1),
        queue_max: NonZeroUsize::MIN,
    }));
}

use std::collections::VecDeque;
use std::time::Duration;

use bytes::Bytes;
use muster_machines::identity::NodeId;
use muster_machines::time::Timestamp;
use rand::Rng;

use super::channel::Channel;
use crate::{Arrival, Destination, Event, Fate, Outcome, SendError};

/// A medium without sharing: frames neither wait nor collide.
///
/// Arrivals are determined when a frame is sent. A unicast is sent once, like a broadcast. Its sender learns the outcome at
/// its arrival, or at its latest possible arrival if it is lost.
#[derive(Debug)]
pub(super) struct Ideal {
    latency: Duration,
    jitter: Duration,
    in_reach: Vec<NodeId>,
}

impl Ideal {
    pub(super) const fn new(latency: Duration, jitter: Duration) -> Self {
        Self {
            latency,
            jitter,
            in_reach: Vec::new(),
        }
    }

    pub(super) fn send(
        &mut self,
        now: Timestamp,
        from: NodeId,
        to: Destination,
        datagram: &Bytes,
        channel: &mut Channel,
        events: &mut VecDeque<Event>,
    ) -> Result<(), SendError> {
        let mut in_reach = std::mem::take(&mut self.in_reach);
        channel.in_reach(from, &mut in_reach)?;
        let mut arrived = None;
        for id in in_reach.drain(..) {
            if channel.draw_reception(now, from, id) && !channel.draw_loss(from, id) {
                let at = now + self.travel_time(channel);
                if to == Destination::To(id) {
                    arrived = Some(at);
                }
                let (to, datagram) = (id, datagram.clone());
                let source = None;
                events.push_back(Event::Arrival(Arrival {
                    at,
                    to,
                    datagram,
                    source,
                    peer: None,
                }));
            }
        }
        if let Destination::To(to) = to {
            let (at, fate) = match arrived {
                Some(at) => (at, Fate::Delivered),
                None => (now + self.latency + self.jitter, Fate::GivenUp),
            };
            let datagram = datagram.clone();
            events.push_back(Event::Outcome(Outcome {
                at,
                from,
                to,
                datagram,
                fate,
            }));
        }
        self.in_reach = in_reach;
        Ok(())
    }

    fn travel_time(&self, channel: &mut Channel) -> Duration {
        let jitter = u64::try_from(self.jitter.as_nanos()).unwrap_or(u64::MAX);
        let extra = if jitter > 0 {
            channel.rng.next_u64() % jitter
        } else {
            0
        };
        self.latency + Duration::from_nanos(extra)
    }
}

//! Messages on their way to actors.

use std::collections::{BTreeMap, VecDeque};
use std::hint::black_box;

use muster_machines::identity::NodeId;
use muster_machines::node::Address;

use super::message::Message;

/// Messages that wait for actors, in the order in which they were sent.
///
/// Invariant: `waiting` holds the number of queued messages of each actor, and no backlog exceeds `backlog_max`.
#[derive(Debug)]
pub(super) struct Inbox {
    queue: VecDeque<(NodeId, Message)>,
    /// Queued messages by drone and [`Address`].
    waiting: Vec<[u32; 5]>,
    /// Messages held back for actors that hang.
    backlog: BTreeMap<NodeId, VecDeque<Message>>,
    backlog_max: usize,
}

impl Inbox {
    /// An empty inbox for this many drones and relays; each may have `backlog_max` messages held back.
    pub(super) fn new(nodes: usize, backlog_max: usize) -> Self {
        Self {
            queue: VecDeque::new(),
            waiting: vec![[0; 5]; nodes],
            backlog: BTreeMap::new(),
            backlog_max,
        }
    }

    /// Queues a message; returns how many are now queued for its actor.
    #[inline]
    pub(super) fn push(&mut self, drone: NodeId, message: Message) -> usize {
        let waiting = &mut self.waiting[drone.0 as usize][message.envelope.address() as usize];
        *waiting += 1;
        self.queue.push_back((drone, message));
        *waiting as usize
    }

    /// Takes the first message.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<(NodeId, Message)> {
        let first = self.queue.pop_front();
        if let Some((drone, message)) = &first {
            self.waiting[drone.0 as usize][message.envelope.address() as usize] -= 1;
        }
        first
    }

    /// Holds a message back for an actor that hangs; drops it if the drone's backlog is full.
    pub(super) fn hold_back(&mut self, drone: NodeId, message: Message) {
        let backlog = self.backlog.entry(drone).or_default();
        if backlog.len() < self.backlog_max {
            backlog.push_back(message);
        }
    }

    /// Queues what was held back for a drone.
    pub(super) fn release(&mut self, drone: NodeId) {
        for message in self.backlog.remove(&drone).into_iter().flatten() {
            self.push(drone, message);
        }
    }

    /// Drops all messages for an actor.
    pub(super) fn drop_actor(&mut self, drone: NodeId, address: Address) {
        self.queue
            .retain(|(to, it)| *to != drone || it.envelope.address() != address);
        self.waiting[drone.0 as usize][address as usize] = 0;
        if let Some(backlog) = self.backlog.get_mut(&drone) {
            backlog.retain(|it| it.envelope.address() != address);
        }
    }

    /// Drops all messages for a drone.
    pub(super) fn drop_drone(&mut self, drone: NodeId) {
        self.queue.retain(|(to, _)| *to != drone);
        self.waiting[drone.0 as usize] = [0; 5];
        self.backlog.remove(&drone);
    }

    /// Drops all queued messages.
    pub(super) fn clear(&mut self) {
        self.queue.clear();
        self.waiting.fill([0; 5]);
    }

    /// Loads what a message for a drone will touch, as
    /// [`NodeMachine::read_ahead`](muster_machines::node::NodeMachine::read_ahead) does.
    pub(super) fn read_ahead(&self, drone: NodeId) {
        black_box(self.waiting[drone.0 as usize][0]);
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::mission::Input;
    use muster_machines::node::Envelope;
    use muster_machines::radio;

    use super::*;

    const DRONE: NodeId = NodeId(1);

    fn to_mission() -> Message {
        Message::genuine(Envelope::Mission(Input::Fly))
    }

    fn to_radio() -> Message {
        Message::genuine(Envelope::Radio(radio::Input::Received {
            datagram: bytes::Bytes::new(),
            source: None,
            peer: None,
        }))
    }

    #[test]
    fn queued_messages_are_counted_for_each_actor() {
        let mut inbox = Inbox::new(2, 4);
        assert_eq!(inbox.push(DRONE, to_mission()), 1);
        assert_eq!(inbox.push(DRONE, to_radio()), 1);
        assert_eq!(inbox.push(DRONE, to_mission()), 2);
        inbox.drop_actor(DRONE, Address::Mission);
        assert_eq!(inbox.push(DRONE, to_mission()), 1);
        inbox.pop();
        assert_eq!(inbox.push(DRONE, to_radio()), 1);
    }

    #[test]
    fn backlog_is_limited_and_queued_on_release() {
        let mut inbox = Inbox::new(2, 2);
        for _ in 0..3 {
            inbox.hold_back(DRONE, to_mission());
        }
        assert!(inbox.pop().is_none());
        inbox.release(DRONE);
        assert_eq!(inbox.push(DRONE, to_mission()), 3);
        assert_eq!(std::iter::from_fn(|| inbox.pop()).count(), 3);
    }
}

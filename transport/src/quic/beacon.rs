//! Discovery beacons: a drone broadcasts its signed number; its address is the source address of the beacon.
//!
//! A beacon proves nothing, since it can be recorded and replayed from another address. It only leads to an attempt to
//! connect, in which the peer must prove that it has the drone's key. A beacon is ignored if its sequence number is not
//! above the last one of the same incarnation. Only the last few incarnations are remembered. Beacons don't tell which of
//! two incarnations is the later one.

use std::collections::{BTreeMap, VecDeque};

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::wire::AUTHENTICATOR_LEN;

use super::identity::Identities;

/// Prefix of a beacon. It keeps the signature from being valid for anything else.
const NAME: &[u8] = b"muster beacon 1\0";

/// Length of the signed part, in bytes: the prefix, then swarm, drone, incarnation and sequence number.
const SIGNED_LEN: usize = NAME.len() + 4 * 4;

/// Number of incarnations of a drone that are remembered, the latest heard.
const INCARNATIONS_MAX: usize = 8;

/// Length of a beacon, in bytes.
pub(super) const BEACON_LEN: usize = SIGNED_LEN + AUTHENTICATOR_LEN;

/// A discovery beacon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Beacon {
    pub(super) swarm: SwarmId,
    pub(super) drone: NodeId,
    /// Incarnation of the drone, and sequence number within it.
    pub(super) sequence: (u32, u32),
}

impl Beacon {
    pub(super) fn signed(&self, identities: &dyn Identities) -> [u8; BEACON_LEN] {
        let mut bytes = [0; BEACON_LEN];
        let (signed, signature) = bytes.split_at_mut(SIGNED_LEN);
        let (name, numbers) = signed.split_at_mut(NAME.len());
        name.copy_from_slice(NAME);
        let (incarnation, count) = self.sequence;
        for (field, number) in
            (numbers.chunks_exact_mut(4)).zip([self.swarm.0, self.drone.0, incarnation, count])
        {
            field.copy_from_slice(&number.to_le_bytes());
        }
        signature.copy_from_slice(&identities.sign(signed));
        bytes
    }

    /// Parses a beacon into its content, the signed bytes and the unverified signature; `None` if it is malformed.
    fn parse(bytes: &[u8]) -> Option<(Self, &[u8], &[u8; AUTHENTICATOR_LEN])> {
        let (signed, signature) = bytes.split_at_checked(SIGNED_LEN)?;
        let (numbers, rest) = signed.strip_prefix(NAME)?.as_chunks::<4>();
        let [swarm, drone, incarnation, count] =
            <[_; 4]>::try_from(numbers).ok()?.map(u32::from_le_bytes);
        let beacon = Self {
            swarm: SwarmId(swarm),
            drone: NodeId(drone),
            sequence: (incarnation, count),
        };
        rest.is_empty().then_some(())?;
        Some((beacon, signed, signature.try_into().ok()?))
    }
}

/// The result of a received beacon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Received {
    /// A new beacon of another drone of the swarm.
    Drone(NodeId),
    /// The own beacon, or one of another swarm.
    Ignored,
    /// Malformed, of an untrusted drone, with a wrong signature, or a replay.
    Refused,
}

/// Accepts beacons of trusted drones and refuses replays.
#[derive(Debug)]
pub(super) struct BeaconFilter {
    swarm: SwarmId,
    own: NodeId,
    /// Last sequence number of each remembered incarnation; the incarnation heard last is at the end.
    last: BTreeMap<NodeId, VecDeque<(u32, u32)>>,
}

impl BeaconFilter {
    pub(super) const fn new(swarm: SwarmId, own: NodeId) -> Self {
        Self {
            swarm,
            own,
            last: BTreeMap::new(),
        }
    }

    /// Checks a received beacon. Cheap checks come first; the signature is verified only if `may_verify` allows it.
    pub(super) fn receive(
        &mut self,
        bytes: &[u8],
        identities: &dyn Identities,
        may_verify: impl FnOnce() -> bool,
    ) -> Received {
        let Some((beacon, signed, signature)) = Beacon::parse(bytes) else {
            return Received::Refused;
        };
        if beacon.swarm != self.swarm || beacon.drone == self.own {
            return Received::Ignored;
        }
        if self.is_new(&beacon)
            && identities.is_trusted(beacon.drone)
            && may_verify()
            && identities.verify(beacon.drone, signed, signature)
        {
            self.remember(&beacon);
            return Received::Drone(beacon.drone);
        }
        Received::Refused
    }

    fn is_new(&self, beacon: &Beacon) -> bool {
        let (incarnation, count) = beacon.sequence;
        let incarnations = self.last.get(&beacon.drone);
        let mut known = incarnations.into_iter().flatten();
        known
            .find(|it| it.0 == incarnation)
            .is_none_or(|it| it.1 < count)
    }

    fn remember(&mut self, beacon: &Beacon) {
        let incarnations = self.last.entry(beacon.drone).or_default();
        incarnations.retain(|it| it.0 != beacon.sequence.0);
        if incarnations.len() == INCARNATIONS_MAX {
            incarnations.pop_front();
        }
        incarnations.push_back(beacon.sequence);
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::radio::Authenticator;

    use super::super::identity::{Distrust, Peer, PublicKey};
    use super::*;

    /// A toy signature: a checksum and the number of the drone. Drones below 7 are trusted; drone 7 is revoked.
    struct Summing(u8);

    fn sum(bytes: &[u8]) -> u8 {
        bytes
            .iter()
            .fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
    }

    impl Authenticator for Summing {
        fn sign(&self, covered: &[u8]) -> [u8; AUTHENTICATOR_LEN] {
            let mut signature = [self.0; AUTHENTICATOR_LEN];
            signature[0] = sum(covered);
            signature
        }

        fn verify(&self, sender: NodeId, covered: &[u8], it: &[u8; AUTHENTICATOR_LEN]) -> bool {
            it[0] == sum(covered) && u32::from(it[1]) == sender.0
        }
    }

    impl Identities for Summing {
        fn public_key(&self) -> PublicKey {
            [self.0; 32]
        }

        fn is_trusted(&self, drone: NodeId) -> bool {
            drone.0 < 7
        }

        fn peer(&self, _: &PublicKey) -> Result<Peer, Distrust> {
            Err(Distrust::Stranger)
        }
    }

    const SWARM: SwarmId = SwarmId(3);

    fn beacon(drone: u32, sequence: (u32, u32)) -> Beacon {
        let drone = NodeId(drone);
        Beacon {
            swarm: SWARM,
            drone,
            sequence,
        }
    }

    fn filter() -> BeaconFilter {
        BeaconFilter::new(SWARM, NodeId(0))
    }

    #[test]
    fn each_beacon_is_accepted_once() {
        let mut filter = filter();
        let [first, later, restarted, latest] = [(4, 9), (4, 10), (2, 0), (4, 11)]
            .map(|sequence| beacon(1, sequence).signed(&Summing(1)));
        for (bytes, received) in [
            (first, Received::Drone(NodeId(1))),
            (first, Received::Refused),
            (later, Received::Drone(NodeId(1))),
            (restarted, Received::Drone(NodeId(1))),
            (later, Received::Refused),
            (first, Received::Refused),
            (restarted, Received::Refused),
            (latest, Received::Drone(NodeId(1))),
        ] {
            assert_eq!(filter.receive(&bytes, &Summing(0), || true), received);
        }
    }

    #[test]
    fn recorded_beacons_of_other_incarnations_block_no_new_ones() {
        let mut filter = filter();
        let mut is_accepted = |sequence| {
            let bytes = beacon(1, sequence).signed(&Summing(1));
            filter.receive(&bytes, &Summing(0), || true) == Received::Drone(NodeId(1))
        };
        for count in 0..100 {
            assert!(is_accepted((7, count)));
            for incarnation in [1, 9, u32::MAX] {
                is_accepted((incarnation, count / 2));
                assert!(!is_accepted((incarnation, count / 2)));
            }
        }
        (100..1_000).for_each(|incarnation| assert!(is_accepted((incarnation, 0))));
        assert_eq!(filter.last[&NodeId(1)].len(), INCARNATIONS_MAX);
    }

    #[test]
    fn unverified_beacons_are_refused_and_not_remembered() {
        let mut filter = filter();
        let bytes = beacon(1, (4, 9)).signed(&Summing(1));
        let unverified = filter.receive(&bytes, &Summing(0), || false);
        assert_eq!(unverified, Received::Refused);
        let received = filter.receive(&bytes, &Summing(0), || true);
        assert_eq!(received, Received::Drone(NodeId(1)));
        let may_verify = || panic!("a replay needs no signature check");
        let replayed = filter.receive(&bytes, &Summing(0), may_verify);
        assert_eq!(replayed, Received::Refused);
    }

    #[test]
    fn forged_revoked_and_altered_beacons_are_refused() {
        let mut filter = filter();
        let mut refused = |bytes: &[u8]| {
            assert_eq!(
                filter.receive(bytes, &Summing(0), || true),
                Received::Refused,
                "{bytes:?}"
            );
        };
        refused(&beacon(1, (1, 1)).signed(&Summing(2)));
        refused(&beacon(7, (1, 1)).signed(&Summing(7)));
        let whole = beacon(1, (1, 1)).signed(&Summing(1));
        for len in 0..BEACON_LEN {
            refused(&whole[..len]);
        }
        refused(&[&whole[..], &[0]].concat());
        for at in 0..SIGNED_LEN {
            let mut altered = whole;
            altered[at] ^= 1;
            let received = filter.receive(&altered, &Summing(0), || true);
            assert!(!matches!(received, Received::Drone(_)), "byte {at}");
        }
        assert_eq!(
            filter.receive(&whole, &Summing(0), || true),
            Received::Drone(NodeId(1))
        );
    }

    #[test]
    fn own_beacons_and_those_of_other_swarms_are_ignored() {
        let other = Beacon {
            swarm: SwarmId(4),
            ..beacon(1, (1, 1))
        };
        for bytes in [
            other.signed(&Summing(1)),
            beacon(0, (1, 1)).signed(&Summing(0)),
        ] {
            let received = filter().receive(&bytes, &Summing(0), || true);
            assert_eq!(received, Received::Ignored);
        }
    }
}

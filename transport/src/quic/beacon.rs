//! What a drone says to all of a network so that others find it: who it is, signed. Where it is, is where that comes from.
//!
//! A beacon promises nothing: it can be recorded and said again from elsewhere, and leads to an attempt to connect, in which
//! whoever is there has to prove that it has the drone's key. One that was heard before leads to nothing, nor does one that
//! its drone said before that in the same life, as long as that is one of the few that were heard last. Which of two lives is
//! the later no beacon tells.

use std::collections::{BTreeMap, VecDeque};

use muster_machines::identity::{NodeId, SwarmId};
use muster_machines::wire::AUTHENTICATOR_LEN;

use super::identity::Identities;

/// What a beacon begins with, so that its signature stands for nothing else.
const NAME: &[u8] = b"muster beacon 1\0";

/// How long what is signed is, in bytes: the name, the swarm, the drone, its life, and the how manieth of that life.
const SIGNED_LEN: usize = NAME.len() + 4 * 4;

/// How many lives of a drone are remembered: those that were heard last.
const LIVES_MAX: usize = 8;

/// How long a beacon is, in bytes.
pub(super) const BEACON_LEN: usize = SIGNED_LEN + AUTHENTICATOR_LEN;

/// A drone says that it is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Beacon {
    pub(super) swarm: SwarmId,
    pub(super) drone: NodeId,
    /// Which of the drone's lives it is, and the how manieth beacon of it.
    pub(super) said: (u32, u32),
}

impl Beacon {
    pub(super) fn signed(&self, identities: &dyn Identities) -> [u8; BEACON_LEN] {
        let mut bytes = [0; BEACON_LEN];
        let (signed, signature) = bytes.split_at_mut(SIGNED_LEN);
        let (name, numbers) = signed.split_at_mut(NAME.len());
        name.copy_from_slice(NAME);
        let (incarnation, count) = self.said;
        for (place, number) in
            (numbers.chunks_exact_mut(4)).zip([self.swarm.0, self.drone.0, incarnation, count])
        {
            place.copy_from_slice(&number.to_le_bytes());
        }
        signature.copy_from_slice(&identities.sign(signed));
        bytes
    }

    /// What bytes say, whoever signed them; nothing if they are no beacon.
    fn read(bytes: &[u8]) -> Option<(Self, &[u8], &[u8; AUTHENTICATOR_LEN])> {
        let (signed, signature) = bytes.split_at_checked(SIGNED_LEN)?;
        let (numbers, rest) = signed.strip_prefix(NAME)?.as_chunks::<4>();
        let [swarm, drone, incarnation, count] =
            <[_; 4]>::try_from(numbers).ok()?.map(u32::from_le_bytes);
        let beacon = Self {
            swarm: SwarmId(swarm),
            drone: NodeId(drone),
            said: (incarnation, count),
        };
        rest.is_empty().then_some(())?;
        Some((beacon, signed, signature.try_into().ok()?))
    }
}

/// What became of what came in among the beacons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Heard {
    /// A drone of the own swarm is there.
    Drone(NodeId),
    /// The own beacon, or another swarm's.
    OfNoUse,
    /// It is no beacon, of nobody who is trusted, not signed by its drone, or was heard before.
    Refused,
}

/// Who was heard, in which lives, and when last by its own count; of drones of the fleet only.
#[derive(Debug)]
pub(super) struct Ear {
    swarm: SwarmId,
    own: NodeId,
    /// The life that was heard last is the last one.
    heard: BTreeMap<NodeId, VecDeque<(u32, u32)>>,
}

impl Ear {
    pub(super) const fn new(swarm: SwarmId, own: NodeId) -> Self {
        Self {
            swarm,
            own,
            heard: BTreeMap::new(),
        }
    }

    /// What bytes among the beacons say. What is cheap is looked at first; a signature only if `may_verify` says that there is
    /// time for it.
    pub(super) fn hear(
        &mut self,
        bytes: &[u8],
        identities: &dyn Identities,
        may_verify: impl FnOnce() -> bool,
    ) -> Heard {
        let Some((beacon, signed, signature)) = Beacon::read(bytes) else {
            return Heard::Refused;
        };
        if beacon.swarm != self.swarm || beacon.drone == self.own {
            return Heard::OfNoUse;
        }
        if self.is_new(&beacon)
            && identities.is_trusted(beacon.drone)
            && may_verify()
            && identities.verify(beacon.drone, signed, signature)
        {
            self.remember(&beacon);
            return Heard::Drone(beacon.drone);
        }
        Heard::Refused
    }

    fn is_new(&self, beacon: &Beacon) -> bool {
        let (incarnation, count) = beacon.said;
        let incarnations = self.heard.get(&beacon.drone);
        let mut known = incarnations.into_iter().flatten();
        known
            .find(|it| it.0 == incarnation)
            .is_none_or(|it| it.1 < count)
    }

    fn remember(&mut self, beacon: &Beacon) {
        let incarnations = self.heard.entry(beacon.drone).or_default();
        incarnations.retain(|it| it.0 != beacon.said.0);
        if incarnations.len() == LIVES_MAX {
            incarnations.pop_front();
        }
        incarnations.push_back(beacon.said);
    }
}

#[cfg(test)]
mod tests {
    use muster_machines::radio::Authenticator;

    use super::super::identity::{Distrust, Peer, PublicKey};
    use super::*;

    /// A drone whose signature is a sum and its number; the drones below 8 are the fleet, and 7 was expelled.
    struct Summing(u8);

    fn sum(bytes: &[u8]) -> u8 {
        bytes
            .iter()
            .fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
    }

    impl Authenticator for Summing {
        fn is_trusted(&self, sender: NodeId) -> bool {
            sender.0 < 7
        }

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

        fn peer(&self, _: &PublicKey) -> Result<Peer, Distrust> {
            Err(Distrust::Stranger)
        }
    }

    const SWARM: SwarmId = SwarmId(3);

    fn beacon(drone: u32, said: (u32, u32)) -> Beacon {
        let drone = NodeId(drone);
        Beacon {
            swarm: SWARM,
            drone,
            said,
        }
    }

    fn ear() -> Ear {
        Ear::new(SWARM, NodeId(0))
    }

    #[test]
    fn a_drone_that_says_that_it_is_there_is_heard_once_for_each_time() {
        let mut ear = ear();
        let [first, later, reborn, latest] =
            [(4, 9), (4, 10), (2, 0), (4, 11)].map(|said| beacon(1, said).signed(&Summing(1)));
        for (bytes, heard) in [
            (first, Heard::Drone(NodeId(1))),
            (first, Heard::Refused),
            (later, Heard::Drone(NodeId(1))),
            (reborn, Heard::Drone(NodeId(1))),
            (later, Heard::Refused),
            (first, Heard::Refused),
            (reborn, Heard::Refused),
            (latest, Heard::Drone(NodeId(1))),
        ] {
            assert_eq!(ear.hear(&bytes, &Summing(0), || true), heard);
        }
    }

    #[test]
    fn what_was_recorded_of_other_lives_keeps_no_drone_from_being_heard() {
        let mut ear = ear();
        let mut is_heard = |said| {
            let bytes = beacon(1, said).signed(&Summing(1));
            ear.hear(&bytes, &Summing(0), || true) == Heard::Drone(NodeId(1))
        };
        for count in 0..100 {
            assert!(is_heard((7, count)));
            for incarnation in [1, 9, u32::MAX] {
                is_heard((incarnation, count / 2));
                assert!(!is_heard((incarnation, count / 2)));
            }
        }
        let remembered = |ear: &Ear| ear.heard[&NodeId(1)].len();
        (100..1_000).for_each(|incarnation| assert!(is_heard((incarnation, 0))));
        assert_eq!(remembered(&ear), LIVES_MAX);
    }

    #[test]
    fn without_time_for_a_signature_nobody_is_heard_and_nothing_is_remembered() {
        let mut ear = ear();
        let bytes = beacon(1, (4, 9)).signed(&Summing(1));
        assert_eq!(ear.hear(&bytes, &Summing(0), || false), Heard::Refused);
        let heard = ear.hear(&bytes, &Summing(0), || true);
        assert_eq!(heard, Heard::Drone(NodeId(1)));
        let asked = || panic!("it was heard before");
        assert_eq!(ear.hear(&bytes, &Summing(0), asked), Heard::Refused);
    }

    #[test]
    fn nobody_is_heard_for_another_nor_who_was_expelled_nor_what_was_altered() {
        let mut ear = ear();
        let mut refused = |bytes: &[u8]| {
            assert_eq!(
                ear.hear(bytes, &Summing(0), || true),
                Heard::Refused,
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
            let heard = ear.hear(&altered, &Summing(0), || true);
            assert!(!matches!(heard, Heard::Drone(_)), "byte {at}");
        }
        assert_eq!(
            ear.hear(&whole, &Summing(0), || true),
            Heard::Drone(NodeId(1))
        );
    }

    #[test]
    fn own_beacons_and_those_of_other_swarms_are_of_no_use() {
        let other = Beacon {
            swarm: SwarmId(4),
            ..beacon(1, (1, 1))
        };
        for bytes in [
            other.signed(&Summing(1)),
            beacon(0, (1, 1)).signed(&Summing(0)),
        ] {
            assert_eq!(ear().hear(&bytes, &Summing(0), || true), Heard::OfNoUse);
        }
    }
}

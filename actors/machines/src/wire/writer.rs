//! Bytes as postcard writes them, written without serde: for the packets that drones say all the time.

use crate::identity::{NodeId, NodeSet};
use crate::routing::Reception;

/// Puts to the end what [`Reader`](super::reader::Reader) takes from the front.
pub(super) struct Writer(pub(super) Vec<u8>);

impl Writer {
    pub(super) fn byte(&mut self, byte: u8) {
        self.0.push(byte);
    }

    pub(super) fn number(&mut self, number: u32) {
        self.long_number(number.into());
    }

    pub(super) fn long_number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.byte((number & 0x7f) as u8 | 0x80);
            number >>= 7;
        }
        self.byte(number as u8);
    }

    /// As postcard has it: small numbers of either sign take few bytes.
    pub(super) fn signed(&mut self, number: i32) {
        self.number(((number << 1) ^ (number >> 31)).cast_unsigned());
    }

    pub(super) fn hops(&mut self, hops: Option<u16>) {
        self.or_nothing(hops, |to, hops| to.number(hops.into()));
    }

    pub(super) fn id(&mut self, id: Option<NodeId>) {
        self.or_nothing(id, |to, id| to.number(id.0));
    }

    /// What may be there or not.
    pub(super) fn or_nothing<T>(&mut self, value: Option<T>, write: impl FnOnce(&mut Self, T)) {
        self.byte(value.is_some().into());
        if let Some(value) = value {
            write(self, value);
        }
    }

    /// A set as serde writes it: how many bounds there are, and the distances between them.
    pub(super) fn set(&mut self, set: &NodeSet) {
        self.count(set.distances().count());
        for distance in set.distances() {
            self.number(distance);
        }
    }

    /// How many there are of something.
    pub(super) fn count(&mut self, count: usize) {
        self.number(u32::try_from(count).expect("a packet holds less"));
    }

    /// The distances between the bounds of a set's runs, as bytes.
    pub(super) fn runs(&mut self, set: &NodeSet) {
        self.behind_its_length(|to| set.distances().for_each(|distance| to.number(distance)));
    }

    /// Receptions in the order of their ids, as bytes: the distance from the id before, and the share.
    pub(super) fn receptions(&mut self, receptions: &[Reception]) {
        self.behind_its_length(|to| {
            let mut before = 0;
            for Reception { id, sixteenths } in receptions {
                to.number(id.0 - before);
                to.byte(*sixteenths);
                before = id.0;
            }
        });
    }

    /// What `write` writes, and before it how many bytes that is, which is known only then.
    fn behind_its_length(&mut self, write: impl FnOnce(&mut Self)) {
        let at = self.0.len();
        // Most are so short that their length takes one byte.
        self.byte(0);
        write(self);
        let end = self.0.len();
        let length = end - at - 1;
        if length < 0x80 {
            self.0[at] = length as u8;
        } else {
            self.count(length);
            let taken = self.0.len() - end;
            self.0[at + 1..].rotate_right(taken);
            self.0.remove(at);
        }
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.0.extend_from_slice(bytes);
    }
}

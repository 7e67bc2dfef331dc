//! Bytes as postcard writes them, written without serde: for the packets that drones say all the time.

use std::ops::Range;

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
        let begin = self.0.len();
        for distance in set.distances() {
            self.number(distance);
        }
        let end = self.0.len();
        self.put_length_before(begin..end);
    }

    /// Receptions in the order of their ids, as bytes: the distance from the id before, and the share.
    pub(super) fn receptions(&mut self, receptions: &[Reception]) {
        let begin = self.0.len();
        let mut before = 0;
        for Reception { id, sixteenths } in receptions {
            self.number(id.0 - before);
            self.byte(*sixteenths);
            before = id.0;
        }
        self.put_length_before(begin..self.0.len());
    }

    /// How many bytes were written there comes before them, and is known only now.
    fn put_length_before(&mut self, written: Range<usize>) {
        self.count(written.len());
        let length = self.0.len() - written.end;
        self.0[written.start..].rotate_right(length);
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.0.extend_from_slice(bytes);
    }
}

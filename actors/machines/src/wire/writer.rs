//! Writes postcard's format without serde, for the packets that drones send most.

use super::Reception;
use crate::identity::{NodeId, NodeSet};

/// Appends values that [`Reader`](super::reader::Reader) takes from the front.
pub(super) struct Writer(pub(super) Vec<u8>);

impl Writer {
    pub(super) fn u8(&mut self, byte: u8) {
        self.0.push(byte);
    }

    pub(super) fn u32(&mut self, number: u32) {
        self.u64(number.into());
    }

    pub(super) fn u64(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.u8((number & 0x7f) as u8 | 0x80);
            number >>= 7;
        }
        self.u8(number as u8);
    }

    /// Zigzag encoding: small numbers of either sign take few bytes.
    pub(super) fn i32(&mut self, number: i32) {
        self.u32(((number << 1) ^ (number >> 31)).cast_unsigned());
    }

    pub(super) fn hops(&mut self, hops: Option<u16>) {
        self.option(hops, |writer, hops| writer.u32(hops.into()));
    }

    pub(super) fn id(&mut self, id: Option<NodeId>) {
        self.option(id, |writer, id| writer.u32(id.0));
    }

    /// A tag of 0 or 1, then the value if there is one.
    pub(super) fn option<T>(&mut self, value: Option<T>, write: impl FnOnce(&mut Self, T)) {
        self.u8(value.is_some().into());
        if let Some(value) = value {
            write(self, value);
        }
    }

    /// A set as serde writes it: the number of bounds, and the distances between them.
    pub(super) fn set(&mut self, set: &NodeSet) {
        self.count(set.distances().count());
        for distance in set.distances() {
            self.u32(distance);
        }
    }

    /// A number of elements.
    pub(super) fn count(&mut self, count: usize) {
        self.u32(u32::try_from(count).expect("a packet holds less"));
    }

    /// The distances between the bounds of a set's runs, as bytes.
    pub(super) fn encoded_set(&mut self, set: &NodeSet) {
        self.length_prefixed(|writer| set.distances().for_each(|distance| writer.u32(distance)));
    }

    /// Receptions by rising id, as bytes: the distance from the id before, and the share.
    pub(super) fn receptions(&mut self, receptions: &[Reception]) {
        self.length_prefixed(|writer| {
            let mut before = 0;
            for Reception { id, sixteenths } in receptions {
                writer.u32(id.0 - before);
                writer.u8(*sixteenths);
                before = id.0;
            }
        });
    }

    /// Writes the bytes of `write` with their length before them.
    fn length_prefixed(&mut self, write: impl FnOnce(&mut Self)) {
        let at = self.0.len();
        // Most lengths take one byte.
        self.u8(0);
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

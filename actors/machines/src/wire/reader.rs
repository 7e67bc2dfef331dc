//! Bytes that postcard has written, read without serde: for the packets that drones hear all the time.

use crate::identity::{NodeId, NodeSet};

/// Takes from the front what postcard has written; nothing where it is something else.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl<'a> Reader<'a> {
    #[inline]
    pub(super) fn byte(&mut self) -> Option<u8> {
        let (byte, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*byte)
    }

    #[inline]
    pub(super) fn number(&mut self) -> Option<u32> {
        take_varint(&mut self.0)
    }

    /// One of 64 bits.
    #[inline]
    pub(super) fn long_number(&mut self) -> Option<u64> {
        take_long_varint::<64>(&mut self.0)
    }

    pub(super) fn signed(&mut self) -> Option<i32> {
        let number = self.number()?;
        Some((number >> 1).cast_signed() ^ -(number & 1).cast_signed())
    }

    #[inline]
    pub(super) fn is_there(&mut self) -> Option<bool> {
        match self.byte()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }

    #[inline]
    pub(super) fn hops(&mut self) -> Option<Option<u16>> {
        Some(match self.is_there()? {
            true => Some(u16::try_from(self.number()?).ok()?),
            false => None,
        })
    }

    #[inline]
    pub(super) fn id(&mut self) -> Option<Option<NodeId>> {
        Some(match self.is_there()? {
            true => Some(NodeId(self.number()?)),
            false => None,
        })
    }

    /// A set as serde writes it: how many bounds there are, and the distances between them.
    pub(super) fn set(&mut self) -> Option<NodeSet> {
        let bounds = self.number().filter(|bounds| bounds.is_multiple_of(2))?;
        let mut again = Reader(self.0);
        let mut bound = 0_u32;
        for at in 0..bounds {
            let distance = self.number()?;
            let rises = distance > 0 || at == 0;
            bound = bound.checked_add(distance).filter(|_| rises)?;
        }
        let mut bound = 0;
        Some(NodeSet::of_bounds(
            bounds as usize,
            (0..bounds).map_while(|_| {
                bound += again.number()?;
                Some(bound)
            }),
        ))
    }

    pub(super) fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.number()? as usize;
        let (bytes, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(bytes)
    }
}

/// A varint as postcard has it; what is too long for 32 bits is none.
#[inline]
pub(super) fn take_varint(bytes: &mut &[u8]) -> Option<u32> {
    match **bytes {
        [byte, ref rest @ ..] if byte < 0x80 => {
            *bytes = rest;
            return Some(byte.into());
        }
        [low, high, ref rest @ ..] if high < 0x80 => {
            *bytes = rest;
            return Some(u32::from(low & 0x7f) | u32::from(high) << 7);
        }
        _ => {}
    }
    u32::try_from(take_long_varint::<32>(bytes)?).ok()
}

/// One of as many bytes as a number of so many bits may take, at most 64.
fn take_long_varint<const BITS: usize>(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0_u64;
    for (at, byte) in bytes.iter().enumerate().take(BITS.div_ceil(7)) {
        let shift = 7 * at;
        let bits = u64::from(byte & 0x7f);
        value |= bits << shift;
        if *byte < 0x80 {
            *bytes = &bytes[at + 1..];
            return (bits << shift >> shift == bits).then_some(value);
        }
    }
    None
}

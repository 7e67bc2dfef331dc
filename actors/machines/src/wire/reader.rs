//! Reads postcard's format without serde, for the packets that drones receive most.

use crate::identity::{NodeId, NodeSet};

/// Takes values from the front; `None` if the bytes do not hold one.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl<'a> Reader<'a> {
    #[inline]
    pub(super) fn u8(&mut self) -> Option<u8> {
        let (byte, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*byte)
    }

    #[inline]
    pub(super) fn u32(&mut self) -> Option<u32> {
        take_varint(&mut self.0)
    }

    #[inline]
    pub(super) fn u64(&mut self) -> Option<u64> {
        take_varint_u64::<64>(&mut self.0)
    }

    pub(super) fn i32(&mut self) -> Option<i32> {
        let number = self.u32()?;
        Some((number >> 1).cast_signed() ^ -(number & 1).cast_signed())
    }

    #[inline]
    pub(super) fn option_tag(&mut self) -> Option<bool> {
        match self.u8()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }

    #[inline]
    pub(super) fn hops(&mut self) -> Option<Option<u16>> {
        Some(match self.option_tag()? {
            true => Some(u16::try_from(self.u32()?).ok()?),
            false => None,
        })
    }

    #[inline]
    pub(super) fn id(&mut self) -> Option<Option<NodeId>> {
        Some(match self.option_tag()? {
            true => Some(NodeId(self.u32()?)),
            false => None,
        })
    }

    /// A set as serde writes it: the number of bounds, and the distances between them.
    pub(super) fn set(&mut self) -> Option<NodeSet> {
        let bounds = self.u32().filter(|bounds| bounds.is_multiple_of(2))?;
        // A bound takes at least one byte, whatever count is claimed.
        let most = self.0.len().min(bounds as usize);
        let mut bound = 0_u32;
        let bounds = (0..bounds).map(|at| {
            let distance = self.u32()?;
            let rises = distance > 0 || at == 0;
            bound = bound.checked_add(distance).filter(|_| rises)?;
            Some(bound)
        });
        NodeSet::try_from_bounds(most, bounds)
    }

    pub(super) fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()? as usize;
        let (bytes, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(bytes)
    }
}

/// Takes a postcard varint of up to 32 bits.
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
    u32::try_from(take_varint_u64::<32>(bytes)?).ok()
}

/// Takes a varint of up to `BITS` bits, at most 64.
fn take_varint_u64<const BITS: usize>(bytes: &mut &[u8]) -> Option<u64> {
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

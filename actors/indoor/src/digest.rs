//! FNV-1a (Fowler, Noll, Vo), a word at a time: tells inputs apart that differ by mistake, not those of an attacker.

/// The digest of nothing: the offset basis.
pub(crate) const EMPTY: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// The digest of what `digest` is of, and then a word.
pub(crate) const fn with_word(digest: u64, word: u64) -> u64 {
    (digest ^ word).wrapping_mul(PRIME)
}

/// Colours of leader epochs, as in the report's replay: red, green, blue.
const EPOCHS: [[u8; 3]; 8] = [
    [0x0b, 0x6b, 0xb8],
    [0xcf, 0x53, 0x00],
    [0x00, 0x83, 0x5c],
    [0xb0, 0x47, 0x8a],
    [0x9a, 0x74, 0x00],
    [0x4b, 0x57, 0xc9],
    [0x5f, 0x7a, 0x1f],
    [0x8a, 0x4b, 0x2a],
];

/// Colour of a drone that follows no leader.
const NO_LEADER: [u8; 3] = [0x8f, 0x98, 0xa8];

/// Colour of a drone that is dead.
pub(super) const DEAD: [u8; 3] = [0xb3, 0x26, 0x1e];

/// The colour of a leader epoch, by its index.
pub(super) fn epoch(index: Option<usize>) -> [u8; 3] {
    index.map_or(NO_LEADER, |index| EPOCHS[index % EPOCHS.len()])
}

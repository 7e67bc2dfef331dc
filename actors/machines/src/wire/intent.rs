use serde::{Deserialize, Serialize};

/// Where a drone is and goes: the straight path that it flies. Both ends are equal while it hovers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Intent {
    /// Start of the path: decimetres north, east and down of the mission's home.
    pub from_dm: [i32; 3],
    /// End of the path, in the same frame.
    pub to_dm: [i32; 3],
    /// Lower bound of the share that is flown, in 128ths: 0 to 127.
    pub flown: u8,
    /// Whether the drone gives way to no other: it lands, or follows a master.
    pub has_priority: bool,
}

//! LDROBOT's lidars LD06 and LD19: they turn ten times a second and send packets of twelve ranges at 230,400 Bd.

mod decoder;
mod port;
mod readings;

pub use decoder::{Counts, Decoder, PACKET_SIZE, Packet, Point};
pub use port::Ld19;

//! State machines that take every decision of a drone. They use no socket, no clock, no task and no random source of
//! the host.

pub mod agent;
pub mod flaw;
pub mod formation;
pub mod geodetic;
pub mod geometry;
pub mod identity;
pub mod indoor;
pub mod leader;
pub mod machine;
pub mod mission;
pub mod motion;
pub mod msp;
pub mod navigation;
pub mod node;
mod node_map;
pub mod radio;
pub mod routing;
mod stall;
pub mod supervision;
pub mod time;
pub mod traffic;
pub mod wire;

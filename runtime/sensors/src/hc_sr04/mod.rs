//! Sonars HC-SR04: a pulse on the trigger line sends a ping, and the echo line is high for as long as sound was on its way.

mod edges;
mod gpio;
mod sonar;

pub use edges::{EchoTimer, Edge};
pub use gpio::{Hcsr04, OpenError, Wiring};
pub use sonar::Counts;

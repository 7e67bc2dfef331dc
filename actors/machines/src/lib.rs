//! What each actor of a drone decides, as pure state machines.

//! One drone as a supervision tree of actors.

//! Sessions and links with a controller that a test scripts, over TCP and over a serial line.

mod controller;
mod flow;
mod link;
mod session;

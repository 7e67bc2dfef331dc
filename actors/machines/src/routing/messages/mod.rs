//! Messages (placeholder until merged).
use bytes::Bytes;
use crate::identity::NodeId;
/// Longest message.
pub const MESSAGE_MAX: usize = 1 << 20;
/// A message.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Outgoing { /// Id.
pub id: u32, /// To.
pub to: Destination, /// Reliability.
pub reliability: Reliability, /// Payload.
pub payload: Bytes }
/// To whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Destination { /// One.
Drone(NodeId), /// Leader.
Leader, /// Neighbours.
Neighbours, /// All.
All }
/// How.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reliability { /// Once.
BestEffort, /// Acknowledged.
Acknowledged }
/// Outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outcome { /// Arrived.
Delivered, /// Not.
Expired }

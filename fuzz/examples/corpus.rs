//! Writes the corpus of the targets that decode frames, from the frames of simulated flights. Run it in `fuzz/` when the
//! frame format changes; see CONTRIBUTING.md.

use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::time::Duration;

use bytes::Bytes;
use muster_fuzz::{Drone, Op, scenarios, scratch};
use muster_machines::identity::NodeId;
use muster_machines::wire::{
    self, Accepted, Destination, Message, MessageBody, MessageFrame, PacketKind, decode_frame,
};

/// Time step after which sent frames are delivered.
const STEP: Duration = Duration::from_millis(40);
/// Duration of a flight.
const FLIGHT: Duration = Duration::from_secs(120);
/// The largest piece of a flight in the corpus, in bytes.
const PIECE_MAX: usize = 1_500;
/// Pieces of each flight in the corpus, and half the number of frames.
const KEPT: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for target in ["frames", "drone", "lists"] {
        fs::create_dir_all(corpus.join(target))?;
    }
    for (index, _) in scenarios().iter().enumerate() {
        let (pieces, frames) = fly(index);
        for (nth, piece) in pieces.iter().enumerate() {
            fs::write(corpus.join(format!("drone/flight-{index}-{nth}")), piece)?;
        }
        for (nth, frame) in frames.iter().enumerate() {
            fs::write(corpus.join(format!("frames/flight-{index}-{nth}")), frame)?;
        }
    }
    for (nth, message) in messages().iter().enumerate() {
        let packet = wire::encode_message(message);
        fs::write(corpus.join(format!("frames/message-{nth}")), packet)?;
    }
    for list in ["roster", "revoked"] {
        let file = format!("{list}.toml");
        fs::copy(
            scratch().join("fleet").join(&file),
            corpus.join("lists").join(&file),
        )?;
    }
    Ok(())
}

/// Packets of messages, one with each body.
fn messages() -> Vec<Message> {
    let payload = Bytes::from_static(b"found");
    let bodies = [
        MessageBody::Whole {
            acknowledge: true,
            payload: payload.clone(),
        },
        MessageBody::Piece {
            index: 1,
            length: u32::try_from(wire::MESSAGE_FRAME_MAX + payload.len()).unwrap_or(0),
            payload,
        },
        MessageBody::Receipt {
            session: 7,
            message: 9,
            before: 5,
        },
        MessageBody::Progress {
            session: 7,
            message: 9,
            below: 3,
            beyond: 9,
        },
    ];
    let packet = |body| Message {
        session: 70_000,
        accepted: vec![Accepted {
            by: NodeId(1),
            session: 80_000,
            number: 300,
            before: 3,
        }],
        frame: Some(MessageFrame {
            number: 4,
            flood: Some((NodeId(3), 90_000)),
            hops: 2,
            left_ms: 3_000,
            awaited: NodeId(1).into(),
            origin: NodeId(3),
            origin_session: 90_000,
            message: 2,
            to: Destination::Drone(NodeId(0)),
            body,
        }),
    };
    bodies.map(packet).into()
}

/// Flies a scenario's drones, all in range of each other. Returns pieces of one drone's input, and frames of different kinds
/// and sizes.
fn fly(index: usize) -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let scenario = &scenarios()[index];
    let leader = scenario.plan.centre();
    let ids: Vec<_> = (0..scenario.plan.nodes().min(8)).map(NodeId).collect();
    let watched = ids.iter().position(|id| *id != leader).unwrap_or(0);
    let mut drones: Vec<_> = ids
        .iter()
        .map(|id| Drone::new(scenario, *id, false))
        .collect();
    for (id, drone) in ids.iter().zip(&mut drones) {
        if *id == leader {
            drone.apply(Op::Fly);
        }
    }
    let head = [
        u8::try_from(index).unwrap_or(0),
        u8::try_from(ids[watched].0).unwrap_or(0),
    ];
    let (mut pieces, mut frames) = (Vec::new(), Vec::new());
    let mut known = BTreeSet::new();
    let mut piece = head.to_vec();
    let steps = FLIGHT.as_millis() / STEP.as_millis();
    for step in 0..steps {
        drones
            .iter_mut()
            .for_each(|drone| drone.apply(Op::Wait(STEP)));
        Op::Wait(STEP).write(&mut piece);
        let sent: Vec<_> = drones
            .iter_mut()
            .map(|it| std::mem::take(&mut it.sent))
            .collect();
        for (from, frames_of_one) in sent.iter().enumerate() {
            for frame in frames_of_one {
                for (to, drone) in drones.iter_mut().enumerate().filter(|(to, _)| *to != from) {
                    drone.apply(Op::Datagram(frame.clone()));
                    if to == watched && piece.len() + frame.len() < PIECE_MAX {
                        Op::Datagram(frame.clone()).write(&mut piece);
                    }
                }
                let kind = decode_frame(frame).map(|it| PacketKind::of(it.payload));
                if known.insert((format!("{kind:?}"), frame.len() / 40)) && frames.len() < 2 * KEPT
                {
                    frames.push(frame.to_vec());
                }
            }
        }
        if (step + 1) % (steps / KEPT as u128) == 0 {
            pieces.push(std::mem::replace(&mut piece, head.to_vec()));
        }
    }
    (pieces, frames)
}

//! A session with an operator, over standard input and output.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use muster_runtime::failure::with_causes;
use muster_runtime::file::Lock;

use super::Host;
use super::install;
use super::observe;
use super::protocol::{PROTOCOL, SlotOrder, SlotReply};
use super::systemd::{TRIAL, service};
use super::trial;
use crate::audit;

/// A session ends if nothing was heard for this time, so that a lost connection does not keep the host locked.
const SILENCE_MAX: Duration = Duration::from_secs(10);
/// Pieces of input that wait for the disk.
const PIECES_MAX: usize = 16;
/// Size of a piece, in bytes.
const PIECE: usize = 64 * 1_024;

/// Serves until the input ends or is silent.
///
/// # Errors
/// If the output is closed.
pub(super) fn serve(host: &Host) -> io::Result<()> {
    let (sender, pieces) = sync_channel(PIECES_MAX);
    std::thread::spawn(move || read(io::stdin().lock(), &sender));
    let mut session = Session {
        host,
        lock: None,
        asks_for_updates: false,
        input: BufReader::new(Input {
            pieces,
            piece: Vec::new(),
            at: 0,
        }),
    };
    reply(&SlotReply::Hello {
        protocol: PROTOCOL,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        processor: std::env::consts::ARCH.to_owned(),
        is_root: rustix::process::geteuid().is_root(),
    })?;
    let mut line = String::new();
    loop {
        line.clear();
        match (&mut session.input).take(ORDER_MAX).read_line(&mut line) {
            Ok(0) | Err(_) => return Ok(()),
            Ok(_) => {}
        }
        let answer = match serde_json::from_str(&line) {
            Ok(order) => session.carry_out(order),
            Err(error) => SlotReply::Refused(format!("unknown order: {error}")),
        };
        reply(&answer)?;
    }
}

/// The longest order, in bytes.
const ORDER_MAX: u64 = 1_024 * 1_024;

fn reply(reply: &SlotReply) -> io::Result<()> {
    let mut line = serde_json::to_string(reply)?;
    line.push('\n');
    let mut output = io::stdout().lock();
    output.write_all(line.as_bytes())?;
    output.flush()
}

/// Passes input on in pieces.
fn read(mut input: impl Read, pieces: &SyncSender<Vec<u8>>) {
    let mut buffer = vec![0; PIECE];
    while let Ok(read @ 1..) = input.read(&mut buffer) {
        if pieces.send(buffer[..read].to_vec()).is_err() {
            return;
        }
    }
}

/// Input with a limit on silence.
struct Input {
    pieces: Receiver<Vec<u8>>,
    piece: Vec<u8>,
    at: usize,
}

impl Read for Input {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.at == self.piece.len() {
            self.piece = match self.pieces.recv_timeout(SILENCE_MAX) {
                Ok(piece) => piece,
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
                Err(RecvTimeoutError::Timeout) => return Err(io::ErrorKind::TimedOut.into()),
            };
            self.at = 0;
        }
        let len = buffer.len().min(self.piece.len() - self.at);
        buffer[..len].copy_from_slice(&self.piece[self.at..self.at + len]);
        self.at += len;
        Ok(len)
    }
}

struct Session<'a> {
    host: &'a Host,
    /// Held while this session may change the host.
    lock: Option<Lock>,
    /// Whether audits ask for unattended security updates.
    asks_for_updates: bool,
    input: BufReader<Input>,
}

impl Session<'_> {
    fn carry_out(&mut self, order: SlotOrder) -> SlotReply {
        let changes = !matches!(
            order,
            SlotOrder::Ping
                | SlotOrder::Look
                | SlotOrder::Audit
                | SlotOrder::WithUpdates
                | SlotOrder::Lock { .. }
        );
        if changes && self.lock.is_none() {
            return SlotReply::Refused("the host is not locked by this session".to_owned());
        }
        self.try_to(order)
            .unwrap_or_else(|error| SlotReply::Refused(error.to_string()))
    }

    fn try_to(&mut self, order: SlotOrder) -> io::Result<SlotReply> {
        match order {
            SlotOrder::Ping => {}
            SlotOrder::Look => return Ok(SlotReply::Host(Box::new(observe::host(self.host)?))),
            SlotOrder::Lock { operator } => return self.lock(&operator),
            SlotOrder::Install(incoming) => {
                let sizes = incoming.files.iter().map(|file| file.bytes);
                let bytes = sizes.fold(0, u64::saturating_add);
                let mut contents = (&mut self.input).take(bytes);
                let received = install::receive(&self.host.disk, &incoming, &mut contents);
                // After a refusal the rest is still on its way.
                io::copy(&mut contents, &mut io::sink())?;
                return Ok(match received {
                    Ok(slot) => SlotReply::Installed { slot },
                    Err(refusal) => SlotReply::Refused(with_causes(&refusal)),
                });
            }
            SlotOrder::WithUpdates => self.asks_for_updates = true,
            SlotOrder::Audit => {
                let findings = audit::audit(self.asks_for_updates)?;
                return Ok(SlotReply::Findings(findings));
            }
            SlotOrder::Fix => {
                let findings = audit::fix(self.asks_for_updates)?;
                return Ok(SlotReply::Findings(findings));
            }
            SlotOrder::ConfirmFix => audit::confirm()?,
            SlotOrder::Try { slot } => trial::start(self.host, &slot)?,
            SlotOrder::RollBack => trial::roll_back(self.host)?,
            SlotOrder::Recall { drone } => {
                let service = service(drone);
                if !self.host.systemd.look(&service)?.is_running() {
                    let why = format!(
                        "{service} does not run; if drone {drone} was started by hand, end it there"
                    );
                    return Ok(SlotReply::Refused(why));
                }
                self.host.systemd.run(&["--no-block", "stop", &service])?;
            }
        }
        Ok(SlotReply::Done)
    }

    fn lock(&mut self, operator: &str) -> io::Result<SlotReply> {
        if !rustix::process::geteuid().is_root() {
            return Ok(SlotReply::Refused(
                "only root may change the host".to_owned(),
            ));
        }
        self.host.disk.create()?;
        let path = self.host.disk.home().join("operator");
        let Some(lock) = self.host.disk.try_lock("lock")? else {
            let operator = std::fs::read_to_string(path).unwrap_or_default();
            return Ok(SlotReply::Busy { operator });
        };
        // The lock counts, also on a full disk; the name is for others.
        let _ = std::fs::write(path, operator);
        self.lock = Some(lock);
        // What an interrupted trial or rollback left; a trial that runs ends by itself.
        if !self.host.systemd.look(TRIAL)?.is_running() {
            trial::settle(self.host)?;
        }
        Ok(SlotReply::Done)
    }
}

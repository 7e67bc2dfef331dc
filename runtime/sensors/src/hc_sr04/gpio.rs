//! Sonars on lines of a GPIO chip: pings on a schedule, edges with the kernel's times.

use std::path::Path;
use std::thread;
use std::time::Duration;

use gpiocdev::Request;
use gpiocdev::line::{EdgeDetection, EdgeKind, Value};
use muster_indoor::reading::{Mounting, Reading};
use muster_indoor::sensor::{Schedule, ScheduleError, Source, Turns};

use super::edges::Edge;
use super::sonar::{Counts, Sonar};

/// Length of a trigger; at least 10 µs. Source: *HC-SR04 User Guide*.
const TRIGGER: Duration = Duration::from_micros(12);
/// Most edges that are taken in one go: two for each sonar in ten turns.
const EDGES_MAX: usize = 256;
/// A reading is used for two turns of all sonars.
const TURNS_USED: f64 = 2.0;

/// A sonar's lines and place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wiring {
    /// Line of the chip that sends a ping.
    pub trigger: u32,
    /// Line of the chip that is high until the echo.
    pub echo: u32,
    /// Where the sonar is.
    pub mounting: Mounting,
    /// Whether it looks up or down, so that it disturbs none of the others.
    pub is_vertical: bool,
}

/// Why sonars can't be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The lines can't be had: no such chip or line, or another program holds them.
    #[error("can't use the GPIO lines")]
    Lines(#[from] gpiocdev::Error),
    /// They can't be fired as fast as asked.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
}

/// Sonars on the lines of a chip.
#[derive(Debug)]
pub struct Hcsr04 {
    sonars: Vec<(Wiring, Sonar)>,
    turns: Turns,
    counts: Counts,
    triggers: Request,
    echoes: Request,
}

impl Hcsr04 {
    /// Takes the lines of a chip like `/dev/gpiochip0`, and fires each sonar `rate_hz` times a second from the first read on.
    ///
    /// # Errors
    /// If the lines can't be had, or the rate is too high.
    pub fn open(chip: &Path, wirings: &[Wiring], rate_hz: f64) -> Result<Self, OpenError> {
        let axis = |wiring: &Wiring| (!wiring.is_vertical).then_some(wiring.mounting.bearing_rad);
        let axes: Vec<Option<f64>> = wirings.iter().map(axis).collect();
        let schedule = Schedule::new(&axes, rate_hz)?;
        let lines = |of: fn(&Wiring) -> u32| wirings.iter().map(of).collect::<Vec<u32>>();
        let triggers = Request::builder()
            .on_chip(chip)
            .with_consumer("muster")
            .with_lines(&lines(|wiring| wiring.trigger))
            .as_output(Value::Inactive)
            .request()?;
        let echoes = Request::builder()
            .on_chip(chip)
            .with_consumer("muster")
            .with_lines(&lines(|wiring| wiring.echo))
            .as_input()
            .with_edge_detection(EdgeDetection::BothEdges)
            .request()?;
        let sonar = |wiring: &Wiring| (*wiring, Sonar::new(wiring.mounting));
        Ok(Self {
            sonars: wirings.iter().map(sonar).collect(),
            turns: Turns::new(schedule),
            counts: Counts::default(),
            triggers,
            echoes,
        })
    }

    /// What came of the pings so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Sends the edges that came to their sonars.
    fn take_edges(&mut self) -> Result<(), gpiocdev::Error> {
        for _ in 0..EDGES_MAX {
            if !self.echoes.has_edge_event()? {
                break;
            }
            let event = self.echoes.read_edge_event()?;
            let edge = Edge {
                at: Duration::from_nanos(event.timestamp_ns),
                is_rising: event.kind == EdgeKind::Rising,
            };
            let mut sonars = self.sonars.iter_mut();
            match sonars.find(|(wiring, _)| wiring.echo == event.offset) {
                Some((_, sonar)) => sonar.edge(edge, &mut self.counts),
                None => self.counts.stray += 1,
            }
        }
        Ok(())
    }

    /// Fires the group that is due.
    fn fire(&mut self, now: Duration) -> Result<(), gpiocdev::Error> {
        let Some(group) = self.turns.next(now) else {
            return Ok(());
        };
        for sonar in group {
            let (wiring, sonar) = &mut self.sonars[*sonar];
            sonar.fire(now);
            self.triggers.set_value(wiring.trigger, Value::Active)?;
        }
        thread::sleep(TRIGGER);
        for sonar in group {
            let trigger = self.sonars[*sonar].0.trigger;
            self.triggers.set_value(trigger, Value::Inactive)?;
        }
        Ok(())
    }
}

impl Source for Hcsr04 {
    type Error = gpiocdev::Error;

    /// Fires the sonars that are due, too: call it at least once in a [`Schedule::slot`]. Waits as long as a trigger, 12 µs, and
    /// as the system's timer is late.
    fn read(&mut self, now: Duration, readings: &mut Vec<Reading>) -> Result<(), Self::Error> {
        self.take_edges()?;
        let used = Duration::from_secs_f64(TURNS_USED / self.turns.schedule().rate_hz());
        let sonars = self.sonars.iter_mut();
        let counts = &mut self.counts;
        readings.extend(sonars.filter_map(|(_, sonar)| sonar.reading(now, used, counts)));
        self.fire(now)
    }
}
